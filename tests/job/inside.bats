# Runs over grids that are killed inside a window: with the same bytes they continue there, or begin it again where
# windows are short.

load ../support/store

small=(--method '{"width-1": 32, "width-2": 32, "poisson-depth": 4, "grid-levels": 3}' --faces 400
    --bars residual=100,coverage=0,flipped=100,stretched=100 --quiet)
joint=(--method '{"align": false, "window": 0, "epochs": 1200}')
warm=(--method '{"align": false, "window": 5, "overlap": 2, "epochs": 3000}')
grids=(--method '{"preset": "grids", "window": 5, "overlap": 2, "epochs": 200, "align-nodes": 40, "align-steps": 6}')

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
    check_killed joint "1 1" "${joint[@]}"
}

@test "windows by vertices that are killed inside give the same bytes" {
    check_killed warm "1 2" "${warm[@]}"
}

@test "windows of grids over aligned poses that are killed inside give the same bytes" {
    "$NEUPIG" run capture/points -o grids-whole "${small[@]}" "${grids[@]}" >grids.log
    for state in 0 1; do
        killed_at state:$state "$NEUPIG" run capture/points -o grids "${small[@]}" "${grids[@]}" >grids.log 2>&1
    done
    "$NEUPIG" run capture/points -o grids "${small[@]}" "${grids[@]}"
    grep -q resumed_frames grids/report.json
    grep -q '"solver": "grids"' grids/report.json
    cmp grids-whole/frames.jsonl grids/frames.jsonl
    diff -r grids-whole/meshes grids/meshes
    # another mesh goes with it, also between frames
    "$NEUPIG" apply grids --mesh grids/reference.ply -o carried --fps-scale 2
    [ "$(ls carried/*.ply | wc -l)" -eq 15 ]
    "$NEUPIG" apply grids --mesh grids/reference.ply -o same
    run "$NEUPIG" eval same grids/meshes --samples 1000
    [[ "$output" == *"Corr 0.00000"* ]]
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
