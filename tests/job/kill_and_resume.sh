#!/bin/bash
# Kill a run at random moments, start it again each time, and compare with a run that was left alone.
#
#   tests/kill_and_resume.sh [MOMENTS] [FRAMES] [SEED] [CAPTURE [OPTIONS...]]
#
# MOMENTS (40) kills of a run over FRAMES (64) made frames, or over those of CAPTURE.  NEUPIG names the command.
# Every moment gets a folder of its own: the run is killed (-9) there once, started again, and must end with the
# same exit code and the same bytes in every mesh.  Ends with 0 when all do.
set -u
source "$(dirname "$0")/../support/store.bash"
moments=${1:-40} frames=${2:-64} seed=${3:-1} capture=${4:-}
shift $(($# < 4 ? $# : 4))
neupig=${NEUPIG:-build/neupig}
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
options=("$@")
if [ -z "$capture" ]; then
    capture=$folder/capture/points
    "$neupig-bodies" --body bar --frames "$frames" --points 800 -o "$folder/capture" >"$folder/synth.log" || exit 1
    options=(--method '{"epochs": 12, "poisson-depth": 4, "window": 8, "overlap": 2,
                        "align-nodes": 60}' --faces 600
    --bars residual=100,coverage=0 "${options[@]}")
fi

work() { # OUT
    "$neupig" run "$capture" -o "$1" --quiet "${options[@]}" >"$1.log" 2>&1
}

same() { # OUT: the same files with the same bytes as the run that was left alone
    cmp -s "$folder/whole/reference.ply" "$1/reference.ply" && cmp -s "$folder/whole/frames.jsonl" "$1/frames.jsonl" &&
        diff -rq "$folder/whole/meshes" "$1/meshes" >/dev/null
}

begun=$(date +%s%N)
work "$folder/whole"
expected=$?
taken_ms=$((($(date +%s%N) - begun) / 1000000))
case $expected in 0 | 7) ;; *) cat "$folder/whole.log" && exit 1 ;; esac
echo "a run takes $taken_ms ms and ends with $expected"

RANDOM=$seed
good=0
for ((i = 1; i <= moments; i++)); do
    out=$folder/killed
    at_ms=$((RANDOM * taken_ms / 32768))
    rm -rf "$out"
    work "$out" &
    pid=$!
    sleep "$(printf '%d.%03d' $((at_ms / 1000)) $((at_ms % 1000)))"
    worker=$(pgrep -P $pid -x neupig || echo $pid)
    kill -9 $worker 2>/dev/null
    wait $pid 2>/dev/null
    states=$(records "$out")
    work "$out"
    status=$?
    if [ $status -eq $expected ] && same "$out"; then
        good=$((good + 1))
        echo "$i: killed after $at_ms ms with $states states: the same"
    else
        echo "$i: killed after $at_ms ms with $states states: ended with $status, not the same"
        cat "$out.log"
        diff -rq "$folder/whole/meshes" "$out/meshes" | head -3
    fi
done
echo "$good of $moments"
[ $good -eq "$moments" ]
