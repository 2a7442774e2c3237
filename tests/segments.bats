# Captures whose topology changes: the alarm, a reference per segment, their overlap, and going on after a kill.

small=(--epochs 10 --width-1 64 --width-2 64 --faces 2000 --poisson-depth 6 --window 10 --overlap 2 --samples 200
    --align-nodes 300 --align-steps 8 --grid-levels 4 --max-residual 100 --max-flipped 100 --min-coverage 0
    --segment-min 4 --quiet)

setup_file() {
    cd "$BATS_FILE_TMPDIR"
    "$NEUPIG" synth --body two --frames 14 --change 7 --points 1500 --cell 0.05 -o two >synth.log
    "$NEUPIG" run two/points -o whole "${small[@]}" --segments auto --keyframe 3 >whole.log 2>&1
}

setup() {
    cd "$BATS_FILE_TMPDIR"
}

# within FRAME WANTED: no more than two frames apart
within() {
    [ "$1" -ge $(($2 - 2)) ] && [ "$1" -le $(($2 + 2)) ]
}

# alarm OUT DIRECTION: from which frame, or null
alarm() {
    python3 -c '
import json, sys
told = json.load(open(sys.argv[1] + "/report.json"))["stages"]["evaluate"]["topology"][sys.argv[2]]
print(told["from_frame"] if told else "null")' "$1" "$2"
}

same() {
    cmp whole/segments.json "$1/segments.json"
    diff -r whole/links "$1/links"
    for segment in whole/segment_*; do
        diff -r "$segment/meshes" "$1/$(basename "$segment")/meshes"
        cmp "$segment/reference.ply" "$1/$(basename "$segment")/reference.ply"
    done
    [ "$(ls -d "$1"/segment_* | wc -l)" -eq "$(ls -d whole/segment_* | wc -l)" ]
}

@test "a second object raises the alarm at its frame, and the run ends with 7" {
    run "$NEUPIG" run two/points -o one "${small[@]}" --keyframe 3
    echo "$output"
    [ "$status" -eq 7 ]
    [[ "$output" == *"no longer explains the points"*"far from the surface"* ]]
    from=$(alarm one forward)
    within "$from" 7
    [ "$(alarm one backward)" = null ]
    [ "$(grep -c '"unexplained":true' one/frames.jsonl)" -eq $((14 - from)) ]
    sed -n $((from + 1))p one/frames.jsonl | grep -q '"unexplained":true'
    grep -q '"exit_code": 7' one/done.json
}

@test "a keyframe with the object raises it backward" {
    run "$NEUPIG" run two/points -o back "${small[@]}" --keyframe 10
    echo "$output"
    [ "$status" -eq 7 ]
    within "$(alarm back backward)" 6
    [ "$(alarm back forward)" = null ]
}

@test "a ball that disappears raises it, though its surface hides on the bar's points" {
    "$NEUPIG" synth --body gone --frames 16 --change 8 --points 1500 --cell 0.05 -o gone >>synth.log
    for key in 3 6; do
        run "$NEUPIG" run gone/points -o gone$key "${small[@]}" --keyframe $key
        echo "$output"
        [ "$status" -eq 7 ]
        [ "$(alarm gone$key forward)" -eq 8 ]
        [ "$(alarm gone$key backward)" = null ]
    done
    [[ "$output" == *"one part that has lost most of its points"* ]]
}

@test "a hand that leaves the hip raises the alarm, unless the weld was cut" {
    "$NEUPIG" synth --body hands --frames 14 --change 6 --points 1500 --cell 0.04 -o hands
    run "$NEUPIG" run hands/points -o welded "${small[@]}" --keyframe 3 --welds keep
    echo "$output"
    [ "$status" -eq 7 ]
    within "$(alarm welded forward)" 6
}

@test "noise, outliers, holes and cameras raise none" {
    quiet() {
        local name=$1
        shift
        "$NEUPIG" synth --frames 10 --cell 0.04 -o "$name" "$@"
        "$NEUPIG" run "$name/points" -o "$name-out" "${small[@]}" || [ $? -eq 7 ]
        [ "$(alarm "$name-out" forward)" = null ]
        [ "$(alarm "$name-out" backward)" = null ]
    }
    quiet noisy --points 1200 --noise 0.5 --outliers 5
    quiet holes --body bar --points 1000 --holes 3
    quiet ring --points 1200 --cameras 5 --width 64
    quiet camera --points 1200 --cameras 1 --width 96
}

@test "each segment explains its frames, and the overlap is told" {
    [ -e whole/done.json ]
    [ ! -e whole/segments.partial.json ]
    [ ! -e whole/meshes ]
    python3 - <<'END'
import json, os
told = json.load(open("whole/segments.json"))
first, second = told["segments"]
assert told["status"] == "ok"
assert first["first_frame"] == 0 and second["last_frame"] == 13
assert first["last_frame"] + 1 == second["first_frame"] and abs(second["first_frame"] - 7) <= 2
for segment in told["segments"]:
    assert segment["topology"] == {"forward": None, "backward": None}, segment
    assert segment["first_frame"] <= segment["keyframe"] <= segment["last_frame"]
    lines = [json.loads(line) for line in open("whole/" + segment["folder"] + "/frames.jsonl")]
    own = [line["number"] for line in lines if not line.get("shared")]
    assert own == list(range(segment["first_frame"], segment["last_frame"] + 1))
    assert len(lines) - len(own) == segment["shared_first"] + segment["shared_last"]
    os.makedirs("own/" + segment["folder"])
    for line in lines:
        if not line.get("shared"):
            os.link("whole/" + segment["folder"] + "/" + line["file"],
                    "own/" + segment["folder"] + "/" + os.path.basename(line["file"]))
overlap, = told["overlaps"]
assert len(overlap["frames"]) == 2 and overlap["link_frame"] in overlap["frames"]
for link in overlap["links"]:
    rows = open("whole/" + link["file"]).read().split()[1:]
    assert len(rows) == link["vertices"] > 100
    for row in rows:
        values = [float(value) for value in row.split(",")]
        assert abs(sum(values[2:5]) - 1) < 1e-4 and values[5] >= 0
END
    for segment in own/*; do
        first=$(basename "$(ls "$segment" | head -1)" .ply)
        last=$(basename "$(ls "$segment" | tail -1)" .ply)
        run "$NEUPIG" eval "$segment" two/truth --samples 5000 \
            --frames "$((10#${first#frame_})):$((10#${last#frame_} + 1))"
        echo "$output"
        [ "$status" -eq 0 ]
        echo "$output" | sed 's/.*CD \([0-9.]*\).*/\1/;q' | awk '{ exit !($1 < 40) }'
    done
}

@test "killed in the first run, at the cut or in a segment it goes on to the same" {
    second=$(basename "$(ls -d whole/segment_* | tail -1)")
    for sign in job segments.partial.json "$second/job"; do
        rm -rf again
        "$NEUPIG" run two/points -o again "${small[@]}" --segments auto --keyframe 3 >again.log 2>&1 &
        pid=$!
        until [ -e "again/$sign" ]; do
            kill -0 $pid
            sleep 0.05
        done
        kill -KILL $pid
        wait $pid || true
        [ ! -e again/done.json ]
        "$NEUPIG" run two/points -o again "${small[@]}" --segments auto --keyframe 3
        same again
    done
    run "$NEUPIG" run two/points -o again "${small[@]}" --segments auto --keyframe 3
    [ "$status" -eq 0 ]
    same again
}

@test "a capture that does not change is one segment, byte for byte that of a run without segments" {
    "$NEUPIG" synth --body bar --frames 9 --points 500 --cell 0.06 -o bar
    "$NEUPIG" run bar/points -o bar-one "${small[@]}"
    "$NEUPIG" run bar/points -o bar-auto "${small[@]}" --segments auto
    diff -r bar-one/meshes bar-auto/meshes
    cmp bar-one/reference.ply bar-auto/reference.ply
    cmp bar-one/frames.jsonl bar-auto/frames.jsonl
    [ "$(grep -c '"folder"' bar-auto/segments.json)" -eq 1 ]
    run "$NEUPIG" run bar/points -o bar-auto "${small[@]}"
    [ "$status" -eq 0 ]
}

@test "segments are not mixed with a run without, with other frames or with a live source" {
    cp -r whole mixed
    run "$NEUPIG" run two/points -o mixed "${small[@]}" --keyframe 3
    [ "$status" -eq 2 ]
    [[ "$output" == *"2 segments"*--restart* ]]
    run "$NEUPIG" run two/points -o mixed "${small[@]}" --keyframe 3 --segments auto --frames 0:13
    [ "$status" -eq 2 ]
    [[ "$output" == *"other frames"*--restart* ]]
    run "$NEUPIG" run - -o live "${small[@]}" --segments auto </dev/null
    [ "$status" -eq 2 ]
    run "$NEUPIG" run two/points -o mixed "${small[@]}" --keyframe 3 --frames 0:5 --restart
    echo "$output"
    [ "$status" -eq 0 ]
    [ ! -e mixed/segments.json ]
    [ ! -e mixed/links ]
    [ "$(ls -d mixed/segment_* 2>/dev/null | wc -l)" -eq 0 ]
    [ "$(ls mixed/meshes | wc -l)" -eq 5 ]
}
