#!/bin/bash
# What the system can do to a run: writes that fail, processes that compete for the kernel cache.
#
#   tests/faults.sh writes [KINDS [FIRST [STRIDE [LAST]]]]  every (STRIDE-th) write, fsync and rename fails in turn
#   tests/faults.sh allocations [FIRST [STRIDE [LAST]]]     every (STRIDE-th) request for memory fails in turn
#   tests/faults.sh cache [ROUNDS [PROCESSES]]              8 processes at once on a cold kernel cache, 20 rounds
#
# NEUPIG names the command (build/neupig); fault_shim.so and fault_run lie beside it.  Ends with 0 when all is as
# it should be.
set -euo pipefail
neupig=$(realpath "${NEUPIG:-build/neupig}")
tools=$(dirname "$neupig")
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
export XDG_CACHE_HOME=${XDG_CACHE_HOME:-$HOME/.cache}
small=(epochs 2 faces 200 poisson-depth 4 align-nodes 30 align-steps 3
    bars residual=100,flipped=100,stretched=100,coverage=0 window 3 overlap 1)
bad=0

capture() {
    "$neupig-bodies" --body bar --frames 4 --points 400 -o capture >synth.log
}

work() { # OUT: one run; its exit code is in $status
    local method= i
    for ((i = 0; i < ${#small[@]}; i += 2)); do method+="${method:+, }\"${small[i]}\": \"${small[i + 1]}\""; done
    status=0
    "$neupig" run capture/points -o "$1" --quiet --method "{$method}" >"$1.log" 2>&1 || status=$?
}

complain() {
    echo "$*"
    bad=$((bad + 1))
}

# Whatever lies under a final name in $1 is what a whole run leaves there.
nothing_partial() {
    local file
    for file in reference.ply frames.jsonl meshes; do
        [ -e "$1/$file" ] || continue
        if [ -d "$1/$file" ]; then
            for file in "$1"/meshes/*.ply; do
                [ ! -e "$file" ] || cmp -s "$file" whole/meshes/"$(basename "$file")" || return 1
            done
        else
            cmp -s "$1/$file" "whole/$file" || return 1
        fi
    done
    [ ! -e "$1/done.json" ]
}

same_results() {
    diff -r whole/meshes "$1/meshes" >/dev/null && cmp -s whole/frames.jsonl "$1/frames.jsonl" && [ -e "$1/done.json" ]
}

# The n-th call of a kind fails: ENOSPC (from then on), EIO, SYNC, RENAME end with 5, leave nothing partial, and the
# next run goes on; SHORT and EINTR are no failure at all.
one_write() { # KIND N; 1 once there are not that many calls
    local kind=$1 n=$2 order=$1:$2
    [ "$kind" != ENOSPC ] || order=$order+
    rm -rf out mark
    NPG_FAULT=$order NPG_FAULT_UNDER=$PWD/out NPG_FAULT_MARK=$PWD/mark LD_PRELOAD=$tools/fault_shim.so work out
    [ -e mark ] || return 1
    case $kind in
    SHORT | EINTR)
        [ $status -eq 0 ] && same_results out || complain "$kind $n: ended with $status: $(tail -n 1 out.log)"
        return 0
        ;;
    esac
    [ $status -eq 5 ] || complain "$kind $n: ended with $status, not 5: $(tail -n 1 out.log)"
    grep -q "$PWD\|out" out.log || complain "$kind $n: the message names no file: $(tail -n 1 out.log)"
    nothing_partial out || complain "$kind $n: something partial lies under a final name"
    work out
    [ $status -eq 0 ] && same_results out || complain "$kind $n: the run after it ended with $status: $(tail -n 1 out.log)"
    return 0
}

writes() {
    local kinds=${1:-ENOSPC EIO SHORT EINTR SYNC RENAME} first=${2:-1} stride=${3:-1} last=${4:-1000000} kind n
    capture
    work whole
    [ $status -eq 0 ] || { cat whole.log && exit 1; }
    for kind in $kinds; do
        n=$first
        while [ $n -le "$last" ] && one_write "$kind" "$n"; do n=$((n + stride)); done
        echo "$kind: $(((n - first) / stride)) failures below call $n of the run"
        [ $n -gt "$first" ] || complain "$kind: nothing failed"
    done
}

allocations() {
    capture
    "$tools/fault_run" "${1:-1}" "${2:-1}" "${3:-1000000}" "$folder/capture/points" "$folder/out" "${small[@]}" || bad=1
}

cache() {
    local rounds=${1:-20} processes=${2:-8} round i pids
    capture
    work whole
    for ((round = 1; round <= rounds; round++)); do
        rm -rf cold run-*
        mkdir cold
        pids=()
        for ((i = 0; i < processes; i++)); do
            (XDG_CACHE_HOME=$PWD/cold work run-$i && exit $status) &
            pids+=($!)
        done
        for ((i = 0; i < processes; i++)); do
            wait "${pids[i]}" || complain "round $round: process $i ended with $?: $(tail -n 1 run-$i.log)"
            same_results run-$i || complain "round $round: process $i has other results"
        done
    done
    echo "$rounds rounds of $processes processes on a cold cache"
}

case ${1:-} in
writes | allocations | cache) "$@" ;;
*) sed -n '2,/^set/s/^# \{0,1\}//p' "$0" && exit 2 ;;
esac
[ $bad -eq 0 ]
