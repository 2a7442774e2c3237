# Surface that no points support: measured and placed, for the reference and in every frame, with a bar for each.

small=(--epochs 10 --faces 800 --poisson-depth 5 --window 5 --overlap 2 --align-nodes 60 --align-steps 10
    --keyframe 5 --max-residual 100 --min-coverage 0 --max-flipped 100 --max-stretched 100)

setup_file() {
    cd "$BATS_FILE_TMPDIR"
    "$NEUPIG" synth --body bar --frames 14 --points 800 --cycles 0.3 --cameras 1 --width 64 --format obj -o one >synth.log
    "$NEUPIG" synth --body bar --frames 14 --points 800 --cycles 0.3 -o clean >synth.log
    for capture in one clean; do
        code=0
        "$NEUPIG" run $capture/points -o $capture-out --unseen keep "${small[@]}" >$capture.log 2>&1 || code=$?
        echo $code >$capture.code
    done
}

setup() {
    cd "$BATS_FILE_TMPDIR"
}

# The share of each frame, one a line.
shares() {
    sed 's/.*"unsupported_share":\([^,]*\),.*/\1/' "$1/frames.jsonl"
}

@test "a side that no camera saw and that is kept: exit code 7, and every frame says where" {
    cat one.log
    [ "$(cat one.code)" -eq 7 ]
    grep -q "surface is invented: no point of any frame saw it.*the largest part within .* of (" one.log
    grep -q "below the bar: share of the surface that no points support, in %, .*the largest part around (" one.log
    [ "$(grep -c '"good":false' one-out/frames.jsonl)" -eq 14 ]
    shares one-out | awk '{ print } $1 < 0.1 || $1 > 0.8 { exit 1 }'
    # the sensor looks at the side of large z, so the place lies behind the middle of its points
    for n in 00 05 13; do
        middle=$(awk '$1 == "v" { sum += $4; n++ } END { print sum / n }' one/points/*00$n.obj)
        place=$(sed -n 's/.*"number":'$((10#$n))',.*"unsupported_at":\[[^,]*,[^,]*,\([^]]*\)\].*/\1/p' one-out/frames.jsonl)
        echo "frame $n: points around z = $middle, unsupported around $place"
        awk -v m="$middle" -v p="$place" 'BEGIN { exit !(p < m - 0.05) }'
    done
    sed -n '/"invented_at": {/,/}/p' one-out/report.json >place
    cat place
    grep -q '"radius": [0-9.]' place
    [ "$(sed -n '/"unsupported_share": {/,/}/p' one-out/report.json | grep -c '"mean"\|"worst"\|"worst_frame"')" -eq 3 ]
}

@test "bars as high as that let it pass" {
    "$NEUPIG" run one/points -o lenient --unseen keep "${small[@]}" --frames 0:6 --max-invented 100 --max-unsupported 100
    [ "$(grep -c '"good":true' lenient/frames.jsonl)" -eq 6 ]
}

@test "a body that points cover on all sides has none" {
    [ "$(cat clean.code)" -eq 0 ]
    [ "$(shares clean-out | sort -u)" = 0.0 ]
    grep -q '"invented_at": null' clean-out/report.json
    ! grep -q '"unsupported_at":\[[0-9-]' clean-out/frames.jsonl
}

@test "a run that is killed resumes to the same figures" {
    "$NEUPIG" run one/points -o killed --unseen keep "${small[@]}" >killed.log 2>&1 &
    pid=$!
    while kill -0 $pid 2>/dev/null && ! ls killed/job/window*npg >/dev/null 2>&1; do sleep 0.02; done
    kill -KILL $pid 2>/dev/null
    wait $pid || true
    [ ! -e killed/done.json ]
    run "$NEUPIG" run one/points -o killed --unseen keep "${small[@]}"
    echo "$output"
    [ "$status" -eq 7 ]
    grep -q resumed_frames killed/report.json
    cmp one-out/frames.jsonl killed/frames.jsonl
}
