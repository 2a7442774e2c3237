# Surface that no points support: measured and placed, for the reference and in every frame, with a bar for each.

load ../support/store

small=(--method '{"epochs": 10, "poisson-depth": 5, "window": 5, "overlap": 2, "align-nodes": 60, "align-steps": 10}' --faces 800
    --keyframe 5 --bars residual=100,coverage=0,flipped=100,stretched=100)

setup_file() {
    cd "$BATS_FILE_TMPDIR"
    "$NEUPIG-bodies" --body bar --frames 14 --points 800 --cycles 0.3 --cameras 1 --width 64 --format obj -o one >synth.log
    "$NEUPIG-bodies" --body bar --frames 14 --points 800 --cycles 0.3 -o clean >synth.log
    for capture in one clean; do
        code=0
        "$NEUPIG" run $capture/points -o $capture-out --unseen keep "${small[@]}" >$capture.log 2>&1 || code=$?
        echo $code >$capture.code
    done
}

@test "how good a result is stands in its last line, at the top of report.json, and in done.json" {
    for name in one clean; do
        text=$(sed -n '2s/.*"verdict": "\(.*\)",/\1/p' $name-out/report.json)
        echo "$text"
        [ "$(tail -1 $name.log)" = "$text: neupig view $name-out" ]
        for file in report done; do # which have 9 and 12 digits
            sed -n '2,/"look"/{s/^ *//;s/\(\.[0-9]\{4\}\)[0-9]*/\1/;p}' $name-out/$file.json >$file.top
        done
        diff report.top done.top
        grep -q "\"look\": \"neupig view $name-out\"" $name-out/done.json
    done
    [[ "$(tail -1 one.log)" == "0 of 14 frames good, median "*" %, "*" % of the surface without points, worst frame "*"share of the surface that no points support"* ]]
    [[ "$(tail -1 clean.log)" == "14 of 14 frames good, median "*" %, worst frame "*"95 % of its points within"* ]]
    sed -n '/"quality": {/,/}/p' one-out/done.json | tr -d ' \n' | grep -q '"good":0,"frames":14,"median_percent":[0-9.]*,"unseen_percent":[0-9.]*,"worst_frame":[0-9]*,"worst":"share'
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
    "$NEUPIG" run one/points -o lenient --unseen keep "${small[@]}" --frames 0:6 --bars invented=100,unsupported=100
    [ "$(grep -c '"good":true' lenient/frames.jsonl)" -eq 6 ]
}

@test "a body that points cover on all sides has none" {
    [ "$(cat clean.code)" -eq 0 ]
    [ "$(shares clean-out | sort -u)" = 0.0 ]
    grep -q '"invented_at": null' clean-out/report.json
    ! grep -q '"unsupported_at":\[[0-9-]' clean-out/frames.jsonl
}

# lumpy HEIGHT: the truth of frame 5 with three bulges on its flank, as high as that, in metres
lumpy() {
    awk -v height="$1" '$1 == "v" && $4 > 0.1 {
            for (lump = -0.6; lump < 0.7; lump += 0.6) $4 += height * exp(-(($3 - lump) / 0.15) ^ 2)
        } { print }' solid/truth/frame_0005.obj
}

@test "a mesh that is given with lumps on its flank: a figure with place for it and for every frame, exit code 7" {
    "$NEUPIG-bodies" --body bar --frames 8 --points 2000 --cycles 0.3 --format obj -o solid >synth.log
    for height in 0 0.3; do
        lumpy $height >lumpy-$height.obj
        code=0
        "$NEUPIG" run solid/points -o lumpy-$height --reference lumpy-$height.obj "${small[@]}" >lumpy.log 2>&1 || code=$?
        cat lumpy.log
        echo "height $height: exit code $code"
        [ $code -eq $([ $height = 0 ] && echo 0 || echo 7) ]
    done
    grep -q "lumpy-0.3.obj has no point of the keyframe near it, the largest part within .* of (" lumpy.log
    grep -q "below the bar: share of the surface that no points support, in %, .*the largest part around (" lumpy.log
    [ "$(shares lumpy-0 | sort -u)" = 0.0 ]
    shares lumpy-0.3 | awk '{ print } $1 < 0.1 || $1 > 0.5 { exit 1 }'
    sed -n '/"invented_at": {/,/}/p' lumpy-0.3/report.json | tr -d '[],\n' | awk '{ print } !($8 > 0.16) { exit 1 }' # off the flank
}

@test "a run that is killed resumes to the same figures" {
    killed_at state:0 "$NEUPIG" run one/points -o killed --unseen keep "${small[@]}" >killed.log 2>&1
    run "$NEUPIG" run one/points -o killed --unseen keep "${small[@]}"
    echo "$output"
    [ "$status" -eq 7 ]
    grep -q resumed_frames killed/report.json
    cmp one-out/frames.jsonl killed/frames.jsonl
}
