# Live captures through the command: standard input and a folder that grows, longer than the look-ahead.

small=(--method '{"epochs": 2, "poisson-depth": 4, "window": 4, "overlap": 1,
                  "align-nodes": 60}' --faces 300 --quiet --bars residual=100,lost=100,coverage=0,stretched=100,flipped=100
       --look-ahead 6)

setup_file() {
    cd "$BATS_FILE_TMPDIR"
    "$NEUPIG-bodies" --body bar --frames 16 --points 600 -o capture >synth.log
    cat capture/points/*.ply | "$NEUPIG" run - -o piped "${small[@]}" >piped.log
}

setup() {
    cd "$BATS_FILE_TMPDIR"
}

same_meshes() {
    [ "$(ls "$1/meshes" | wc -l)" -eq 16 ]
    for mesh in piped/meshes/*.ply; do cmp "$mesh" "$1/meshes/$(basename "$mesh")"; done
}

# Wait until a file is there, as long as process $2 lives.
await() {
    until [ -e "$1" ]; do
        kill -0 "$2"
        sleep 0.05
    done
}

@test "standard input may be longer than the look-ahead" {
    [ "$(ls piped/meshes | wc -l)" -eq 16 ]
    [ "$(wc -l <piped/frames.jsonl)" -eq 16 ]
    grep -q '"status": "ok"' piped/done.json
    grep -q '"open": true' piped/report.json
}

@test "what was piped is gone once the run is done; the result can be judged, looked at and applied" {
    [ -f piped/job/store.npg ]
    [ ! -e piped/job/frames.npg ]
    [ ! -e piped/job/frames.new ]
    "$NEUPIG" eval --points-only piped capture/points >eval.txt
    "$NEUPIG" view piped -o page.html
    [ -s page.html ]
    "$NEUPIG" apply piped --mesh piped/reference.ply -o applied
    [ "$(ls applied | grep -c '^frame_.*ply$')" -eq 16 ]
}

@test "a folder that grows gives the same meshes, until its end file is there" {
    mkdir -p grows
    "$NEUPIG" run --follow grows -o followed --follow-end 0 "${small[@]}" >followed.log &
    pid=$!
    for file in capture/points/*.ply; do
        name=$(basename "$file")
        head -c 3000 "$file" >"grows/$name" # one part, then the rest
        tail -c +3001 "$file" >>"grows/$name"
    done
    : >grows/capture.end
    wait $pid
    same_meshes followed
    rm -r grows
}

@test "without frames for a while it ends, too, and an incomplete last file is an error" {
    cp -r capture/points idle
    "$NEUPIG" run --follow idle -o idled --follow-end 1 "${small[@]}" >idled.log
    same_meshes idled
    head -c 3000 capture/points/frame_0015.ply >idle/frame_0016.ply
    status=0
    "$NEUPIG" run --follow idle -o cut --follow-end 1 --method '{"follow-settle": 0}' "${small[@]}" 2>cut.log || status=$?
    cat cut.log
    [ "$status" -eq 3 ]
    grep -q 'idle/frame_0016.ply' cut.log
    [ ! -e cut/done.json ]
    status=0
    "$NEUPIG" run --follow idle -o kept --follow-end 1 --method '{"follow-settle": 0}' --keep-going "${small[@]}" \
        2>kept.log || status=$?
    [ "$status" -eq 7 ]
    grep -q 'frame_0016.ply' kept.log
    [ -e kept/meshes/frame_0015.ply ]
    rm -r idle
}

@test "the first finished frame is on disk before the next window is read" {
    mkfifo fifo
    "$NEUPIG" run - -o early "${small[@]}" <fifo >early.log &
    pid=$!
    exec 7>fifo
    cat $(ls capture/points/*.ply | head -$((6 + 4 + 1 - 1))) >&7 # look-ahead + window + overlap - 1
    await early/frames.partial.jsonl $pid
    until [ -s early/frames.partial.jsonl ]; do
        kill -0 $pid
        sleep 0.05
    done
    [ "$(ls early/meshes/*.ply | wc -l)" -ge 1 ]
    cat $(ls capture/points/*.ply | tail -n +$((6 + 4 + 1))) >&7
    exec 7>&-
    wait $pid
    same_meshes early
}

@test "a source that stops in the middle of a frame: exit 3, the frames before it are safe" {
    cat capture/points/*.ply | head -c $((12 * $(stat -c %s capture/points/frame_0000.ply) + 5000)) >cut-stream
    status=0
    "$NEUPIG" run - -o torn "${small[@]}" <cut-stream 2>torn.log || status=$?
    cat torn.log
    [ "$status" -eq 3 ]
    grep -q 'frame 1[0-9]: standard input' torn.log
    [ ! -e torn/done.json ]
    [ ! -e torn/frames.jsonl ]
    # In one gulp the cut may overtake the first window: with a pause between, the finished frames stay.
    (cat $(ls capture/points/*.ply | head -12); until [ -s paused/frames.partial.jsonl ]; do sleep 0.05; done
     head -c 5000 capture/points/frame_0012.ply) |
        "$NEUPIG" run - -o paused "${small[@]}" 2>paused.log || status=$?
    [ "$status" -eq 3 ]
    grep -q 'frame 12: standard input' paused.log
    [ ! -e paused/done.json ]
    sed -n 's/.*"file":"\([^"]*\)".*/\1/p' paused/frames.partial.jsonl >finished
    [ -s finished ]
    while read -r file; do cmp "paused/$file" "piped/$file"; done <finished
}

@test "with keep-going a stream that is torn ends there, and all frames before it are finished" {
    status=0
    "$NEUPIG" run - -o mended --keep-going "${small[@]}" <cut-stream 2>mended.log || status=$?
    cat mended.log
    [ "$status" -eq 7 ]
    grep -q 'taken to end here' mended.log
    frames=$(ls mended/meshes | wc -l)
    [ "$frames" -ge 12 ]
    [ "$frames" -eq "$(wc -l <mended/frames.jsonl)" ]
    grep -q '"status": "partial"' mended/done.json
}

@test "a run does not follow its own results" {
    mkdir -p own/meshes
    for followed in own own/meshes 'own/meshes/*.ply'; do
        status=0
        "$NEUPIG" run --follow "$followed" -o own --quiet 2>own.log || status=$?
        [ "$status" -eq 2 ]
        grep -q 'where this run writes' own.log
    done
}

@test "the bound on memory is said once the plan is known" {
    grep -q '"memory_bound_bytes"' piped/report.json
}

@test "memory does not grow with the length of the source" {
    "$NEUPIG-bodies" --body bar --frames 12 --points 600 -o loop >loop.log
    for times in 1 5; do # there and back, so that nothing leaps
        for i in $(seq $times); do cat loop/points/*.ply $(ls -r loop/points/*.ply); done |
            "$NEUPIG" run - -o "long$times" "${small[@]}" --method '{"epochs": 1, "poisson-depth": 6, "width-1": 32, "width-2": 32, "grid-levels": 3, "align": false}' >long.log
    done
    short=$(sed -n 's/.*"memory_peak_bytes": \([0-9]*\).*/\1/p' long1/report.json)
    long=$(sed -n 's/.*"memory_peak_bytes": \([0-9]*\).*/\1/p' long5/report.json)
    echo "$short $long"
    [ $((100 * long)) -le $((105 * short)) ]
    [ "$(ls long5/meshes | wc -l)" -eq 120 ]
}
