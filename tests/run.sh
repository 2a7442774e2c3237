#!/bin/bash
# All tests: formatting, release build with warnings as errors, everything again with the address and
# undefined-behaviour sanitizers, ring and run with the thread sanitizer, every parser under libFuzzer.
#
#   tests/run.sh [SECONDS]     of fuzzing for each parser: 30, with what earlier runs have learnt and always from
#                              the same seed, so that a failure can be had again; hours of tests/fuzz.sh, which
#                              takes another seed each time, are what a release should have
#
# Installs what is missing (as root, or through sudo).  Stops at the first part that fails; the output ends with
# CTest's summary of the last part run.
set -euo pipefail
fuzz_seconds=${1:-30}
cd "$(dirname "$0")/.."

. samples/packages.sh
# shellcheck disable=SC2086
install_packages $packages_to_build $packages_to_test

CTEST_PARALLEL_LEVEL=$(nproc)
export CTEST_PARALLEL_LEVEL

# Build a preset, all of it or one target.
build()
{
    echo "== Build: $1"
    cmake --preset "$1" -DNPG_WERROR=ON >/dev/null
    cmake --build --preset "$1" ${2:+--target "$2"}
}

echo "== Format"
find pipeline stages kernels tools tests samples \( -name '*.[ch]' -o -name '*.cpp' -o -name '*.hpp' \) -print0 |
    xargs -0 clang-format-14 --dry-run -Werror --ferror-limit=1

build release

build asan
echo "== Tests: address and undefined behaviour"
ctest --preset asan

build tsan threaded_tests
echo "== Tests: threads"
ctest --preset tsan -L tsan

echo "== Fuzz"
FUZZ_SEED=1 tests/fuzz.sh "$fuzz_seconds"

echo "== Tests: release"
ctest --preset release
