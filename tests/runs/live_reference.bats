# The reference of live runs: from all frames of the look-ahead, as from files; killed or stopped on the way.

small=(--method '{"epochs": 10, "poisson-depth": 4, "window": 5, "overlap": 2, "align-nodes": 60, "align-steps": 10}' --faces 800
    --bars residual=100,lost=100,coverage=0,flipped=100,stretched=100,invented=100)
open=(--look-ahead 9 --keyframe 5)

setup_file() {
    cd "$BATS_FILE_TMPDIR"
    local capture from
    for seed in {0..9}; do
        capture=noisy$seed
        "$NEUPIG-bodies" --body bar --frames 14 --points 800 --noise 1 --cycles 0.5 --seed $seed -o $capture >synth.log
        : >$capture/points/capture.end
        for from in key all; do
            cat $capture/points/*.ply | "$NEUPIG" run - -o $capture-$from "${small[@]}" "${open[@]}" \
                --method "{\"reference-from\": \"$from\"}" >$capture-$from.log 2>&1
        done
        "$NEUPIG" run $capture/points -o $capture-files "${small[@]}" --keyframe 5 -q
    done
}

setup() {
    cd "$BATS_FILE_TMPDIR"
}

# What the run into $2 has must be that of $1, byte by byte, but for the places that the frames came from.
same() {
    cmp "$1/reference.ply" "$2/reference.ply"
    for run in "$1" "$2"; do sed 's/"source":\(null\|"[^"]*"\)//' "$run/frames.jsonl" >"$run.frames"; done
    cmp "$1.frames" "$2.frames"
    diff -r "$1/meshes" "$2/meshes"
}

# A figure of an evaluation: figure NAME CAPTURE RUN
figure() {
    "$NEUPIG" eval "$2-$3" "$2" --samples 20000 | sed -n "s/.*\b$1 \([0-9.]*\).*/\1/p"
}

# report RUN KEY: of its stage fuse
report() {
    sed -n '/"fuse": {/,/}/s/.*"'"$2"'": \([0-9.e+-]*\).*/\1/p' "$1/report.json"
}

# Ten seeds: by themselves they scatter widely.
@test "a source longer than the look-ahead has a reference from all its frames, better than from one" {
    [ "$(report noisy0-all frames)" -eq 9 ]
    grep -q '"open": true' noisy0-all/report.json
    grep -q "points of 9 frames in the keyframe's pose" noisy0-all.log
    run grep -c "in the keyframe's pose" noisy0-key.log
    [ "$output" -eq 0 ]
    for capture in noisy{0..9}; do
        echo "$(figure CD $capture key) $(figure CD $capture all) $(figure CD $capture files)"
    done | awk '{ print; key += $1; all += $2; files += $3 } END { exit !(all > 0 && all < 0.9 * key && all < 1.15 * files) }'
}

@test "a source that ends inside the look-ahead gives the bytes that files give" {
    "$NEUPIG" run noisy0/points -o files "${small[@]}" -q
    cat noisy0/points/*.ply | "$NEUPIG" run - -o piped "${small[@]}" -q
    "$NEUPIG" run --follow noisy0/points -o followed "${small[@]}" -q
    same files piped
    same files followed
    for key in key key_by_score candidates; do
        diff <(grep "\"$key\"" files/report.json) <(grep "\"$key\"" followed/report.json)
    done
}

@test "so it does with gaps, with a file that can't be read, and where the cache holds nothing" {
    cp -r noisy0/points gaps
    rm gaps/frame_0003.ply gaps/frame_0008.ply
    head -c 2000 noisy0/points/frame_0010.ply >gaps/frame_0010.ply
    local missing status
    for missing in skip hold; do
        local more=("${small[@]}" --missing $missing --keep-going -q)
        status=0
        "$NEUPIG" run gaps -o gaps-files-$missing "${more[@]}" || status=$?
        [ "$status" -eq 7 ]
        "$NEUPIG" run --follow gaps -o gaps-live-$missing "${more[@]}" --method '{"follow-settle": 0}' --cache 0 || status=$?
        [ "$status" -eq 7 ]
        same gaps-files-$missing gaps-live-$missing
    done
}

# Give the points of all frames but the keyframe's a colour: colour FOLDER KEYFILE
colour() {
    python3 -c 'import os, struct, sys
for name in sorted(os.listdir(sys.argv[1])):
    path = os.path.join(sys.argv[1], name)
    head, _, body = open(path, "rb").read().partition(b"end_header\n")
    if not head or name == sys.argv[2]: continue
    rows = [body[at:at + 24] + bytes((200, 40, 10)) for at in range(0, len(body), 24)]
    head += b"".join(b"property uchar " + c + b"\n" for c in (b"red", b"green", b"blue"))
    open(path, "wb").write(head + b"end_header\n" + b"".join(rows))' "$@"
}

has_colours() {
    head -c 400 "$1" | grep -aq "property uchar red"
}

@test "colours are those of all frames of the look-ahead" {
    cp -r noisy0/points coloured
    colour coloured frame_0005.ply
    "$NEUPIG" run --follow coloured -o bright "${small[@]}" "${open[@]}" -q
    "$NEUPIG" run --follow coloured -o dull "${small[@]}" "${open[@]}" --method '{"reference-from": "key"}' -q
    has_colours bright/reference.ply
    has_colours bright/meshes/frame_0013.ply
    ! has_colours dull/reference.ply
}

@test "progress counts the frames of the look-ahead; the share of the whole is 0 until the end is known" {
    "$NEUPIG" run --follow noisy0/points -o watched "${small[@]}" "${open[@]}" --progress json 2>watched.log >progress
    grep -q '"stage":"align","share":0.0,.*"step":9,"steps":9' progress
    sed -n 's/.*"share":\([0-9.]*\).*/\1/p' progress | awk '$1 < last { exit 1 } { last = $1 } END { exit last != 1 }'
}

# Wait as long as process $2 lives until file $1 has $3 bytes.
await() {
    until [ "$(stat -c %s "$1" 2>/dev/null || echo 0)" -ge "$3" ]; do
        kill -0 "$2"
        sleep 0.02
    done
}

@test "killed while the look-ahead comes, or in the fusing pass, a run ends with the same bytes" {
    mkdir grows
    cp $(ls noisy0/points/*.ply | head -5) grows
    "$NEUPIG" run --follow grows -o killed "${small[@]}" "${open[@]}" --follow-end 0 >killed.log 2>&1 &
    local pid=$!
    await killed/job/frames.new $pid 1000 # five records
    kill -KILL $pid
    wait $pid || true
    cp noisy0/points/* grows
    "$NEUPIG" run --follow grows -o killed "${small[@]}" "${open[@]}" >killed.log 2>&1 &
    pid=$!
    until grep -qs NPGREC01group killed/job/store.new; do
        kill -0 $pid
        sleep 0.02
    done
    kill -KILL $pid
    wait $pid || true
    [ ! -e killed/job/store.npg ]
    cp -r killed other
    run "$NEUPIG" run --follow grows -o killed "${small[@]}" "${open[@]}"
    echo "$output"
    [ "$status" -eq 0 ]
    [[ "$output" == *"groups of frames that an earlier run followed are read back"* ]]
    same noisy0-all killed
    # another capture under the same options: what was followed of the first is not taken
    "$NEUPIG" run --follow noisy1/points -o left "${small[@]}" "${open[@]}" -q
    cp noisy1/points/frame_0008.ply grows
    run "$NEUPIG" run --follow grows -o other "${small[@]}" "${open[@]}"
    [ "$status" -eq 0 ]
    [[ "$output" != *"are read back"* ]]
}

@test "a stop is heeded while the look-ahead comes and in the fusing pass" {
    mkdir few
    cp $(ls noisy0/points/*.ply | head -5) few
    "$NEUPIG" run --follow few -o stopped "${small[@]}" "${open[@]}" --follow-end 0 >stopped.log 2>&1 &
    local pid=$! status=0
    await stopped/job/frames.new $pid 1000
    kill -TERM $pid
    wait $pid || status=$?
    [ "$status" -eq 75 ]
    "$NEUPIG" run --follow noisy0/points -o halted "${small[@]}" "${open[@]}" --method '{"align-steps": 500,
        "align-nodes": 600}' >halted.log 2>&1 &
    pid=$!
    status=0
    until grep -qs NPGREC01pose halted/job/store.new; do
        kill -0 $pid
        sleep 0.02
    done
    kill -TERM $pid
    wait $pid || status=$?
    [ "$status" -eq 75 ]
    [ ! -e halted/done.json ]
}
