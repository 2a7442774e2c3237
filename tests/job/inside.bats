# Runs without alignment that are killed inside a window: they continue there, with the same bytes.

load ../support/store

small=(--method '{"align": false, "width-1": 32, "width-2": 32, "poisson-depth": 5, "samples": 100,
                  "grid-levels": 3, "state-every": 0}' --faces 400 --bars residual=100,flipped=100
    --quiet)
joint=(--method '{"window": 0, "epochs": 240}')
warm=(--method '{"window": 5, "overlap": 2, "epochs": 30}')
surface=(--method '{"preset": "grids", "window": 5, "overlap": 2, "epochs": 6}')

setup_file() {
    cd "$BATS_FILE_TMPDIR"
    "$NEUPIG-bodies" --body bar --frames 8 --points 500 -o capture >synth.log
}

setup() {
    cd "$BATS_FILE_TMPDIR"
}

# Start a run into $1 and kill it with signal $2 once it has written $3 states inside windows; then its options.
kill_inside() {
    local out=$1 signal=$2 wanted=$3 seen=0 last=none now
    shift 3
    "$NEUPIG" run capture/points -o "$out" "${small[@]}" "$@" >"$out.log" 2>&1 &
    local pid=$!
    while kill -0 $pid 2>/dev/null && [ $seen -lt "$wanted" ]; do
        now=$(stat -c %i-%s "$out/job/store.npg" 2>/dev/null || echo none)
        if [ "$now" != "$last" ] && { [ $seen -gt 0 ] || [ "$(records "$out" inside)" -gt 0 ]; }; then
            seen=$((seen + 1))
            last=$now
        fi
    done
    kill "-$signal" $pid 2>/dev/null || true
    killed_status=0
    wait $pid || killed_status=$?
}

# The job in $1, killed at $2 places and finished, against one that was left alone; then its options.
check_killed() {
    local name=$1 places=$2
    shift 2
    "$NEUPIG" run capture/points -o "$name-whole" "${small[@]}" "$@" >"$name.log"
    for place in $places; do
        kill_inside "$name" KILL "$place" "$@"
        [ ! -e "$name/done.json" ]
    done
    [ "$(records "$name" inside)" -gt 0 ]
    "$NEUPIG" run capture/points -o "$name" "${small[@]}" "$@"
    grep -q resumed_frames "$name/report.json"
    cmp "$name-whole/reference.ply" "$name/reference.ply"
    cmp "$name-whole/frames.jsonl" "$name/frames.jsonl"
    diff -r "$name-whole/meshes" "$name/meshes"
}

@test "one joint window that is killed twice gives the same bytes" {
    check_killed joint "5 9" "${joint[@]}"
}

@test "windows by vertices that are killed inside give the same bytes" {
    check_killed warm "3 12" "${warm[@]}"
}

@test "windows by the surface that are killed inside give the same bytes" {
    check_killed surface "2 3" "${surface[@]}"
}

@test "SIGTERM inside a window keeps what was done" {
    kill_inside stopped TERM 3 "${joint[@]}" --method '{"epochs": 5000}'
    [ $killed_status -eq 75 ]
    [ "$(records stopped inside)" -gt 0 ]
}

@test "a damaged state inside a window is said" {
    kill_inside hurt KILL 3 "${joint[@]}" --method '{"epochs": 5000}'
    truncate -s -100 hurt/job/store.npg
    run "$NEUPIG" run capture/points -o hurt "${small[@]}" "${joint[@]}" --method '{"epochs": 5000}' --restart=no --max-memory 1
    [[ "$output" == *"store.npg is damaged"* ]]
}

@test "windows that a warm start lost are counted over all that a run was broken off" {
    "$NEUPIG-bodies" --body bar --frames 11 --points 500 -o lost-capture >lost.log
    "$NEUPIG-bodies" --body bar --frames 11 --points 500 --noise 4 -o noisy-capture >>lost.log
    cp noisy-capture/points/*000[567].ply lost-capture/points/
    mv capture whole-capture
    mv lost-capture capture
    "$NEUPIG" run capture/points -o lost-whole "${small[@]}" "${warm[@]}" --keyframe 2 >>lost.log
    grep -q '"windows_lost": [1-9]' lost-whole/report.json
    "$NEUPIG" run capture/points -o lost "${small[@]}" "${warm[@]}" --keyframe 2 >>lost.log 2>&1 &
    local pid=$!
    while kill -0 $pid 2>/dev/null && [ "$(newest_state lost)" != 1 ]; do :; done
    kill -KILL $pid 2>/dev/null || true
    wait $pid || true
    [ ! -e lost/done.json ]
    "$NEUPIG" run capture/points -o lost "${small[@]}" "${warm[@]}" --keyframe 2
    grep -q resumed_frames lost/report.json
    [ "$(grep windows_lost lost/report.json)" = "$(grep windows_lost lost-whole/report.json)" ]
    mv capture lost-capture
    mv whole-capture capture
}
