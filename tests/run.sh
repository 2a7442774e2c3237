#!/bin/bash
# All tests: formatting, release build with warnings as errors, the unit tests and short whole runs with the address
# and undefined-behaviour sanitizers, threads with the thread sanitizer, every parser under libFuzzer, all tests of
# the release build.
#
#   tests/run.sh [SECONDS]     of fuzzing for each parser: 5, from its seeds and what earlier runs have learnt, and
#                              always from the same seed, so that a failure can be had again; hours of tests/fuzz.sh,
#                              which takes another seed each time, are what a release should have
#   tests/run.sh --fast        for every change, in 5 minutes: formatting, release build, the rules of tests/structure,
#                              unit tests and a few whole runs (CTest's label "fast")
#
# Installs what is missing (as root, or through sudo).  Stops at the first part that fails; says how long each took;
# the output ends with CTest's summary of the last part run.
set -euo pipefail
cd "$(dirname "$0")/.."
is_fast=no
if [ "${1:-}" = --fast ]; then
    is_fast=yes
    shift
fi
fuzz_seconds=${1:-5}

. samples/packages.sh
# shellcheck disable=SC2086
install_packages $packages_to_build $packages_to_test

cores=$(nproc)
CTEST_PARALLEL_LEVEL=$((cores + (cores + 1) / 2)) # many tests wait: for files that grow, signals, disks
export CTEST_PARALLEL_LEVEL

times="" title="" began=$SECONDS
part() # TITLE
{
    [ -z "$title" ] || times+="$(printf '%5d s  %s' $((SECONDS - began)) "$title")"$'\n'
    title=$1 began=$SECONDS
    [ -z "$title" ] || echo "== $title"
}

# Build a preset, all of it or one target.
build()
{
    part "Build: $1"
    cmake --preset "$1" -DNPG_WERROR=ON >/dev/null
    cmake --build --preset "$1" ${2:+--target "$2"}
}

# The parts so far and their times, then CTest with what it says at the end as the last words.
last_tests() # CTEST'S ARGUMENTS...
{
    local code=0
    ctest --preset release "$@" || code=$?
    part ""
    printf '%s' "$times" >&2
    return $code
}

part "Format"
find pipeline stages kernels tools tests samples \( -name '*.[ch]' -o -name '*.cpp' -o -name '*.hpp' \) -print0 |
    xargs -0 -n 32 -P "$cores" clang-format-14 --dry-run -Werror --ferror-limit=1

build release
if [ $is_fast = yes ]; then
    part "Tests: fast ones"
    last_tests -L fast
    exit
fi

build asan
part "Tests: address and undefined behaviour"
ctest --preset asan

build tsan threaded_tests
part "Tests: threads"
ctest --preset tsan -L tsan

part "Fuzz"
FUZZ_SEED=1 tests/fuzz.sh "$fuzz_seconds"

part "Tests: release"
last_tests
