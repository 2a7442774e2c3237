#!/bin/bash
# Line coverage of the parsers, the writers and what keeps state on disk: builds with gcov's counters into
# build/coverage, runs the tests of these parts and prints a table, worst file first.
#
#   tests/coverage.sh [PERCENT]     exit code 1 when all lines together are covered less than PERCENT (90)
#
# LAUNCHER (a compiler cache, say) is handed on to CMake as the compilers' launcher.
set -euo pipefail
cd "$(dirname "$0")/.."
wanted=${1:-90}
build=build/coverage

# Parsers: captures, configurations.  Writers: meshes, exports, files.  State: jobs, checkpoints, fits.
shopt -s nullglob
files=(stages/ingest/formats/*.c stages/ingest/stream.c stages/ingest/frame_*.c stages/export/*.c stages/export/exporters/*.c
    stages/job/*.c stages/optimize/checkpoint.c stages/optimize/fit_state.c stages/optimize/time_code.c
    pipeline/json_*.c pipeline/options.c pipeline/file.c pipeline/custom_stage.c)

tests="test_readers test_bad_files test_writers test_exporters test_time_code test_export test_store test_checkpoint test_frame_files
test_options test_file test_ingest test_follow test_custom_stage test_abi input resume apply export exports formats live"

cmake -G Ninja -B "$build" -DCMAKE_BUILD_TYPE=Debug -DCMAKE_C_FLAGS_DEBUG="-O1 -g --coverage" \
    -DCMAKE_CXX_FLAGS_DEBUG="-O1 -g" -DCMAKE_EXE_LINKER_FLAGS=--coverage -DCMAKE_SHARED_LINKER_FLAGS=--coverage \
    ${LAUNCHER:+-DCMAKE_C_COMPILER_LAUNCHER="$LAUNCHER" -DCMAKE_CXX_COMPILER_LAUNCHER="$LAUNCHER"} >/dev/null
targets="neupig"
for test in $tests; do
    ! compgen -G "tests/*/$test.c" >/dev/null || targets="$targets $test"
done
# shellcheck disable=SC2086
cmake --build "$build" --target $targets

find "$build" -name '*.gcda' -delete
# A test that fails still covers; that it fails is said by CTest.
failed=0
# shellcheck disable=SC2086
ctest --test-dir "$build" -j "$(nproc)" -R "^($(echo $tests | tr ' ' '|'))\$" || failed=$?

objects=$(pwd)/$build/CMakeFiles/npg_objects.dir
table=$(mktemp)
trap 'rm -f "$table"' EXIT
for file in "${files[@]}"; do
    [ -e "$file" ] || continue
    counters="$objects/$file.gcda"
    if [ ! -e "$counters" ]; then
        echo "0 $(grep -c . "$file") $file" >>"$table" # no test has ever run it
        continue
    fi
    gcov -n -o "$(dirname "$counters")" "$counters" 2>/dev/null |
        awk -v file="$file" -v OFS=' ' '
            /^File / { mine = index($0, "/" file "'\''") }
            mine && /^Lines executed:/ {
                split($2, share, /[:%]/)
                print int(share[2] * $4 / 100 + 0.5), $4, file
                exit
            }' >>"$table"
done
echo "covered  lines"
sort -k 3 "$table" | awk '{ printf "%6.1f %% %6d  %s\n", 100 * $1 / $2, $2, $3 }' | sort -n
awk -v wanted="$wanted" '
    { hit += $1; all += $2 }
    END {
        printf "%6.1f %% %6d  all of these\n", 100 * hit / all, all
        exit 100 * hit / all < wanted
    }' "$table"
exit "$failed"
