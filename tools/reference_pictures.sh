#!/bin/bash
# Draws what the reference gains from the points of all frames: for three made captures the points of the keyframe,
# the reference from them alone and the reference from all frames, side by side.
#
#   tools/reference_pictures.sh [OUT]    OUT: where the pictures go, samples/guide by default
#
# NEUPIG: the program, build/neupig by default.  Takes a few minutes on two cores.
set -euo pipefail
cd "$(dirname "$0")/.."
neupig=${NEUPIG:-build/neupig}
out=${1:-samples/guide}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# draw NAME KEY AZIMUTH OPTION...: the references of the capture NAME, and their figures where there is a truth
draw() {
    local name=$1 key=$2 azimuth=$3 from code
    shift 3
    for from in key all; do
        code=0
        "$neupig" run "$work/$name/points" -o "$work/$name-$from" --method "{\"reference-from\": \"$from\"}" --keyframe "$((10#$key))" "$@" \
            >"$work/log" 2>&1 || code=$?
        # 7: finished, with frames below the quality bar
        [ $code -eq 0 ] || [ $code -eq 7 ] || { cat "$work/log" && exit $code; }
        echo "$name, $from: exit code $code, good $(grep -c '"good":true' "$work/$name-$from/frames.jsonl") frames"
        [ ! -d "$work/$name/truth" ] || "$neupig" eval "$work/$name-$from" "$work/$name/truth"
    done
    "$neupig" render "$work/$name"/points/*"$key".ply "$work/$name-key/reference.ply" "$work/$name-all/reference.ply" \
        -o "$out/references_$name.png" --columns 3 --height 330 --azimuth "$azimuth" --samples 3 --point-size 0.5
}

"$neupig" synth -o "$work/noisy" --frames 24 --points 800 --noise 0.2 --no-normals
draw noisy 12 35
"$neupig" synth -o "$work/sensors" --frames 24 --points 1500 --cameras 3 --width 64 --no-normals
draw sensors 12 35
python3 tests/fuse/turning_body.py "$work/turning"
draw turning 06 110 --sensor "$work/turning/sensor.txt" --faces 3000
