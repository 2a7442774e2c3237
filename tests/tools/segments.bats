# Captures whose topology changes: the alarm, a reference per segment, their overlap, and going on after a kill.

small=(--method '{"epochs": 10, "poisson-depth": 6, "window": 10, "overlap": 2,
                  "align-nodes": 300, "align-steps": 8, "segment-min": 4}' --faces 2000
    --bars residual=100,flipped=100,coverage=0
    --effort quick # one reference and one keyframe: what segments add is the same; "usual" where a test asks for it
    --quiet)

setup_file() {
    cd "$BATS_FILE_TMPDIR"
    # so coarse a surface is sometimes stretched over the ball as a whole, a failed fit that is no alarm: not with this seed
    "$NEUPIG-bodies" --body two --frames 14 --change 7 --points 1500 --cell 0.05 --seed 2 -o two >synth.log
    for ((i = 0; i + 1 < ${#small[@]}; i += 2)); do # numbers and objects as they stand, words in quotes
        value=${small[i + 1]}
        [[ $value == [{0-9]* ]] || value="\"$value\""
        printf '"%s": %s,\n' "${small[i]#--}" "$value"
    done >keys
    echo "{\"output\": \"night\", \"defaults\": {$(cat keys) \"segments\": \"auto\"}, \"captures\": [
        {\"input\": \"two/points\", \"name\": \"two\", \"keyframe\": 3}]}" >night.json
    "$NEUPIG" batch night.json >night.table 2>night.log
    cp -r night/two whole
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
    for segment in whole/segment_*; do
        diff -r "$segment/meshes" "$1/$(basename "$segment")/meshes"
        cmp "$segment/reference.ply" "$1/$(basename "$segment")/reference.ply"
    done
    [ "$(ls -d "$1"/segment_* | wc -l)" -eq "$(ls -d whole/segment_* | wc -l)" ]
}

@test "a batch says the segments in its verdict and its table, and leaves them alone when started again" {
    cat night.log night.table
    second=$(basename "$(ls -d night/two/segment_* | tail -1)")
    from=$((10#${second#segment_}))
    within "$from" 7
    grep -Eq '^capture +verdict +good frames +segments ' night.table
    grep -Eq "^two +done +14 of 14 +2 \(from $from\) " night.table
    python3 - "$second" "$from" <<'END'
import json, sys
for told in json.load(open("night/two/verdict.json")), json.load(open("night/batch.json"))["captures"][0]:
    first, second = told["segments"]
    assert first["folder"] == "segment_0000" and first["first_frame"] == 0 and first["keyframe"] == 3 and not first["cause"]
    assert second["folder"] == sys.argv[1] and second["first_frame"] == int(sys.argv[2]) and second["last_frame"] == 13
    # the object's points are far from the surface, or the surface that went to them has left its own
    assert any(cause in second["cause"] for cause in ("far from the surface", "no points near them")) and second["status"] == "ok"
END
    before=$(find night/two -type f ! -name log.jsonl ! -name verdict.json -printf '%p %T@ %i\n' | sort)
    peak=$(grep peak_memory night/two/verdict.json)
    run "$NEUPIG" batch night.json
    echo "$output"
    [ "$status" -eq 0 ]
    [[ "$output" == *"two: was done already"* ]]
    [ "$before" = "$(find night/two -type f ! -name log.jsonl ! -name verdict.json -printf '%p %T@ %i\n' | sort)" ]
    [ "$peak" = "$(grep peak_memory night/two/verdict.json)" ]
    run "$NEUPIG" batch night.json --segments one # what the command line says wins
    [ "$status" -eq 1 ]
    [[ "$output" == *"usage"*"2 segments"*--restart* ]]
    sed 's/"auto"/"some"/' night.json >bad.json
    run "$NEUPIG" batch bad.json
    [ "$status" -eq 2 ]
    [[ "$output" == *'bad.json: defaults.segments: neither'* ]]
}

@test "a second object raises the alarm at its frame, and the run ends with 7" {
    run "$NEUPIG" run two/points -o one "${small[@]}" --keyframe 3
    echo "$output"
    [ "$status" -eq 7 ]
    [[ "$output" == *"no longer explains the points"*@("far from the surface"|"no points near them")* ]]
    from=$(alarm one forward)
    within "$from" 7
    [ "$(alarm one backward)" = null ]
    [ "$(grep -c '"unexplained":true' one/frames.jsonl)" -eq $((14 - from)) ]
    sed -n $((from + 1))p one/frames.jsonl | grep -q '"unexplained":true'
    grep -q '"exit_code": 7' one/done.json
    mkdir single
    cp -r one single/two
    sed 's/"auto"/"one"/; s/night/single/' night.json >single.json
    run "$NEUPIG" batch single.json
    echo "$output"
    [ "$status" -eq 7 ]
    [[ "$output" == *"from frame $from on the reference no longer explains the points; \"segments\": \"auto\""* ]]
    # asked for segments it is done anew with them
    run "$NEUPIG" run two/points -o one "${small[@]}" --keyframe 3 --segments auto --no-quiet
    echo "$output"
    [ "$status" -eq 0 ]
    [[ "$output" == *"was done with one reference, which does not explain all frames"* ]]
    same one
}

@test "append and apply: a segment is named, and carries another mesh through its own frames" {
    run "$NEUPIG" append whole
    [ "$status" -eq 2 ]
    [[ "$output" == *"2 segments"*--segments*--restart* ]]
    second=$(basename "$(ls -d whole/segment_* | tail -1)")
    run "$NEUPIG" append "whole/$second"
    [ "$status" -eq 2 ]
    [[ "$output" == *"is one segment of a capture"* ]]
    run "$NEUPIG" apply whole --mesh "whole/$second/reference.ply" -o carried
    echo "$output"
    [ "$status" -eq 2 ]
    [[ "$output" == *"whole/segment_0000 (frames 0 to "*"whole/$second (frames "*" to 13)"* ]]
    [ ! -e carried ]
    "$NEUPIG" apply "whole/$second" --mesh "whole/$second/reference.ply" -o carried
    [ "$(ls carried | grep -c ply)" -eq "$(ls "whole/$second/meshes" | wc -l)" ]
    run "$NEUPIG" eval carried "whole/$second/meshes" --samples 1000
    [[ "$output" == *"Corr 0.00000"* ]]
    "$NEUPIG" verify whole
    run "$NEUPIG" export whole --export npz
    [ "$status" -eq 2 ]
    [[ "$output" == *"whole/$second"* ]]
    "$NEUPIG" export "whole/$second" --export npz
    "$NEUPIG" verify whole
}

@test "a keyframe with the object raises it backward" {
    run "$NEUPIG" run two/points -o back "${small[@]}" --keyframe 10
    echo "$output"
    [ "$status" -eq 7 ]
    within "$(alarm back backward)" 6
    [ "$(alarm back forward)" = null ]
}

@test "a ball that disappears raises it, though its surface hides on the bar's points" {
    "$NEUPIG-bodies" --body gone --frames 16 --change 8 --points 1500 --cell 0.05 -o gone >>synth.log
    for key in 3 6; do
        run "$NEUPIG" run gone/points -o gone$key "${small[@]}" --keyframe $key
        echo "$output"
        [ "$status" -eq 7 ]
        [ "$(alarm gone$key forward)" -eq 8 ]
        [ "$(alarm gone$key backward)" = null ]
    done
    [[ "$output" == *"one part that has lost most of its points"* ]]
}

@test "a hand that leaves the hip raises the alarm" {
    "$NEUPIG-bodies" --body hands --frames 14 --change 6 --points 1500 --cell 0.04 -o hands
    run "$NEUPIG" run hands/points -o welded "${small[@]}" --keyframe 3
    echo "$output"
    [ "$status" -eq 7 ]
    within "$(alarm welded forward)" 6
}

@test "noise, outliers, holes and cameras raise none" {
    quiet() {
        local name=$1 body=$2
        shift 2
        "$NEUPIG-bodies" --body "$body" --frames 10 --cell 0.04 -o "$name" "$@"
        "$NEUPIG" run "$name/points" -o "$name-out" "${small[@]}" || [ $? -eq 7 ]
        [ "$(alarm "$name-out" forward)" = null ]
        [ "$(alarm "$name-out" backward)" = null ]
    }
    quiet noisy walker --points 1200 --noise 0.5 --outliers 5
    quiet holes bar --points 1000 --holes 3
    quiet ring walker --points 1200 --cameras 5 --width 64
    quiet camera walker --points 1200 --cameras 1 --width 96
}

@test "each segment explains its frames, and the overlap is told" {
    [ -e whole/done.json ]
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
cut = second["first_frame"] if second["shared_first"] else second["first_frame"] + 2
assert overlap == {"between": [first["folder"], second["folder"]], "frames": [cut - 2, cut - 1]}, overlap
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

@test "each segment has the colours of the points in its frames" {
    mkdir painted
    python3 - <<'END'
import glob, os, struct
for path in glob.glob("two/points/*.ply"): # blue, and red by the frame: the second segment's frames are redder
    head, body = open(path, "rb").read().split(b"end_header\n", 1)
    colour = bytes((10 * int(path[-8:-4]), 0, 200))
    rows = (body[i:i + 24] + colour for i in range(0, len(body), 24))
    properties = b"".join(b"property uchar %s\n" % name for name in (b"red", b"green", b"blue"))
    open("painted/" + os.path.basename(path), "wb").write(head + properties + b"end_header\n" + b"".join(rows))
END
    "$NEUPIG" run painted -o hues "${small[@]}" --effort usual --segments auto --keyframe 3
    second=$(basename "$(ls -d hues/segment_* | tail -1)")
    [ "$second" != segment_0000 ]
    PYTHONPATH="$BATS_TEST_DIRNAME/../support" python3 - segment_0000 "$second" <<'END'
import sys
from plain_files import read_vertices
reds = []
for segment in sys.argv[1:]:
    rows = read_vertices(f"hues/{segment}/reference.ply")
    assert all(abs(r["blue"] - 200) <= 1 and r["green"] <= 1 and r["alpha"] >= 254 for r in rows), rows[:5]
    reds.append(sorted(r["red"] for r in rows)[len(rows) // 2])
assert reds[0] < 70 < reds[1], reds
END
    for segment in hues/segment_*; do
        for mesh in "$segment"/meshes/*.ply; do head -c 500 "$mesh" | grep -aq "property uchar red"; done
    done
}

@test "killed in the first run, at the cut or in a segment it goes on to the same" {
    second=$(basename "$(ls -d whole/segment_* | tail -1)")
    for sign in job segments.json "$second/job"; do
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

@test "where the lists can't be written the exit code is 5, nothing is done, and the next run goes on" {
    shim=$(dirname "$NEUPIG")/fault_shim.so
    [ -e "$shim" ] || skip "not under a sanitizer"
    mkdir late # all segments are there, what comes after them is not
    cp -r whole/segment_* late
    python3 -c '
import json
told = json.load(open("whole/segments.json"))
del told["status"], told["overlaps"]
json.dump(told, open("late/segments.json", "w"))'
    for kind in EIO SYNC; do
        for ((n = 1; n < 20; n++)); do
            rm -rf failed mark
            cp -r late failed
            NPG_FAULT=$kind:$n NPG_FAULT_UNDER=$PWD/failed NPG_FAULT_MARK=$PWD/mark LD_PRELOAD=$shim \
                run "$NEUPIG" run two/points -o failed "${small[@]}" --segments auto --keyframe 3
            [ -e mark ] || break
            echo "$kind $n: $output"
            [ "$status" -eq 5 ]
            [ ! -e failed/done.json ]
            cmp -s failed/segments.json late/segments.json || cmp failed/segments.json whole/segments.json
            "$NEUPIG" run two/points -o failed "${small[@]}" --segments auto --keyframe 3
            same failed
            [ -e failed/done.json ]
        done
        [ "$n" -ge 3 ] && [ "$n" -lt 20 ]
    done
}

@test "a capture that does not change is one segment, byte for byte that of a run without segments" {
    "$NEUPIG-bodies" --body bar --frames 9 --points 500 --cell 0.06 -o bar
    "$NEUPIG" run bar/points -o bar-one "${small[@]}"
    "$NEUPIG" run bar/points -o bar-auto "${small[@]}" --segments auto
    diff -r bar-one/meshes bar-auto/meshes
    cmp bar-one/reference.ply bar-auto/reference.ply
    cmp bar-one/frames.jsonl bar-auto/frames.jsonl
    [ "$(grep -c '"folder"' bar-auto/segments.json)" -eq 1 ]
    run "$NEUPIG" run bar/points -o bar-auto "${small[@]}"
    [ "$status" -eq 0 ]
    # frames that come later: as without segments
    "$NEUPIG-bodies" --body bar --frames 11 --points 500 --cell 0.06 -o longer
    cp longer/points/frame_0009.ply longer/points/frame_0010.ply bar/points
    "$NEUPIG" append bar-auto -q
    [ "$(ls bar-auto/meshes | wc -l)" -eq 11 ]
    [ ! -e bar-auto/segments.json ]
    "$NEUPIG" run bar/points -o bar-auto "${small[@]}" --segments auto
    grep -q '"frames": 11' bar-auto/segments.json
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
    [ "$(ls -d mixed/segment_* 2>/dev/null | wc -l)" -eq 0 ]
    [ "$(ls mixed/meshes | wc -l)" -eq 5 ]
}
