#!/bin/bash
# Fuzz every parser with libFuzzer, the address and the undefined-behaviour sanitizer.
#
#   tests/fuzz.sh [SECONDS [RUNS [PARSER...]]]
#
# Each target runs over its seeds, then for SECONDS (10) or RUNS (0: no limit) on inputs it makes; as many at a
# time as there are processors.  A parser that crashes, leaks, keeps memory or passes its bound fails, and the
# input that did it stays in build/fuzz/found.  What is learnt is kept in build/fuzz/corpus for the next time.
# FUZZ_SEED names the seed of the inputs; without it each time has another.
set -euo pipefail
cd "$(dirname "$0")/.."
seconds=${1:-10} runs=${2:-0}
shift $(($# < 2 ? $# : 2))
build=build/fuzz
[ -e $build/build.ninja ] || cmake -S . -B $build -G Ninja -DCMAKE_BUILD_TYPE=None -DNPG_FUZZ=ON -DNPG_WERROR=ON \
    -DCMAKE_C_COMPILER=clang-14 -DCMAKE_CXX_COMPILER=clang++-14 >/dev/null
cmake --build $build --target fuzzers
tests/fuzz_seeds.sh $build/seeds
mkdir -p $build/found $build/logs

# The bound on input sizes keeps runs quick; -rss_limit_mb is for what the library does not count itself.
fuzz() { # PARSER
    local name=$1 status=0
    mkdir -p $build/corpus/"$name"
    $build/fuzz_"$name" -max_total_time="$seconds" -runs="$([ "$runs" -gt 0 ] && echo "$runs" || echo -1)" \
        -max_len=4096 -rss_limit_mb=1024 -timeout=20 -detect_leaks=1 -print_final_stats=1 \
        -artifact_prefix=$build/found/"$name"- ${FUZZ_SEED:+-seed=$FUZZ_SEED} $build/corpus/"$name" $build/seeds/"$name" \
        >$build/logs/"$name" 2>&1 || status=$?
    if [ $status -eq 0 ]; then
        echo "$name: $(sed -n 's/^stat::number_of_executed_units: *//p' $build/logs/"$name") runs, no fault"
    else
        echo "$name: FAILED, $build/logs/$name:"
        tail -n 40 $build/logs/"$name"
    fi
    return $status
}
export -f fuzz
export build seconds runs LSAN_OPTIONS="suppressions=$PWD/tests/lsan.supp:print_suppressions=0" \
    ASAN_OPTIONS=allocator_may_return_null=1:detect_leaks=1
[ $# -gt 0 ] || set -- $(cd $build && ls fuzz_* | sed 's/^fuzz_//')
printf '%s\n' "$@" | xargs -P "$(nproc)" -I{} bash -c 'fuzz {}'
