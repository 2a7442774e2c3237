# Runs that are killed, stopped, damaged, out of room, changed, or continued with more frames.

load ../support/store

small=(--method '{"epochs": 10, "poisson-depth": 4, "window": 5, "overlap": 2,
                  "align-nodes": 40, "align-steps": 6}' --faces 400
    --keyframe 6 --bars residual=100,lost=100,coverage=0,flipped=100 --quiet)
free=(--method '{"align": false, "width-1": 32, "width-2": 32, "grid-levels": 3, "epochs": 20}')
grids=(--method '{"preset": "grids", "width-1": 32, "width-2": 32, "grid-levels": 3, "epochs": 60}')

# What a run that was killed with two states left is in "broken".
setup_file() {
    cd "$BATS_FILE_TMPDIR"
    "$NEUPIG-bodies" --body bar --frames 12 --points 500 -o capture >synth.log
    "$NEUPIG" run capture/points -o whole "${small[@]}" >whole.log
    kill_at broken KILL 2
    [ ! -e broken/done.json ]
}

setup() {
    cd "$BATS_FILE_TMPDIR"
}

# A run of $input into $1 that gets signal $2 once it has $3 states; the arguments after that are its options.
kill_at() {
    local out=$1 signal=$2 states=$3
    shift 3
    rm -rf "$out"
    signalled_at "$signal" state:$((states - 1)) "$NEUPIG" run "${input:-capture/points}" -o "$out" "${small[@]}" "$@" >"$out.log" 2>&1
}

go_on() {
    run "$NEUPIG" run capture/points -o "$1" "${small[@]}" "${@:2}"
    echo "$output"
    [ "$status" -eq 0 ]
}

same() {
    cmp whole/reference.ply "$1/reference.ply"
    cmp whole/frames.jsonl "$1/frames.jsonl"
    diff -r whole/meshes "$1/meshes"
}

@test "what sensors saw of the frames at hand is known when a killed run goes on" {
    "$NEUPIG" synth -o seen --rig --cameras 2 --frames 12 --cycles 0.2 --width 100 --height 80 >synth.log
    input=seen/rig/rig.json
    local judged=(--bars residual=100,coverage=0,flipped=100,stretched=100,unsupported=100,invented=100,nowhere=100)
    kill_at seen-broken KILL 1 "${judged[@]}"
    [ ! -e seen-broken/done.json ]
    for out in seen-whole seen-broken; do
        run "$NEUPIG" run $input -o $out "${small[@]}" "${judged[@]}"
        echo "$output"
        [ "$status" -eq 0 ] || [ "$status" -eq 7 ]
    done
    grep -q resumed_frames seen-broken/report.json
    grep -q '"nowhere_share":0' seen-whole/frames.jsonl
    cmp seen-whole/frames.jsonl seen-broken/frames.jsonl
}

@test "a killed run goes on and gives the same bytes" {
    cp -r broken killed
    kill_at once KILL 1
    for out in killed once; do
        [ ! -e $out/done.json ]
        go_on $out
        grep -q resumed_frames $out/report.json
        same $out
    done
}

@test "a run killed at random moments gives the same bytes" {
    NEUPIG=$NEUPIG "$BATS_TEST_DIRNAME/kill_and_resume.sh" 2 12 5 capture/points "${small[@]}"
}

@test "SIGTERM inside a window of either solver ends with 75 within 5 s, and the next run goes on" {
    for solver in joint grids; do
        local options=(--method '{"epochs": 500}')
        [ $solver = joint ] || options=("${grids[@]}" "${options[@]}")
        kill_at stopped TERM 1 "${options[@]}"
        [ $killed_status -eq 75 ]
        grep -q "run again to resume" stopped.log
        go_on stopped "${options[@]}"
        grep -q resumed_frames stopped/report.json
    done
}

@test "a finished job says so and does nothing" {
    before=$(stat -c %Y.%Z whole/done.json whole/meshes/frame_0003.ply)
    run "$NEUPIG" run capture/points -o whole "${small[@]}" --no-quiet
    echo "$output"
    [ "$status" -eq 0 ]
    [[ "$output" == *"done already"* ]]
    [ "$before" = "$(stat -c %Y.%Z whole/done.json whole/meshes/frame_0003.ply)" ]
}

@test "damaged and truncated states are said, and the window before is taken" {
    cp -r broken hurt
    cp -r broken cut
    at=$(last_record hurt/job/store.npg state)
    printf '\x5a\xa5' | dd of=hurt/job/store.npg bs=1 seek=$((at + 3000)) conv=notrunc status=none
    truncate -s $((at + 2000)) cut/job/store.npg
    for out in hurt cut; do
        go_on $out
        [[ "$output" == *"is damaged"*"resumes from the window before"* ]]
        same $out
    done
}

@test "damaged latent grids and states of them, over poses and without alignment, are said likewise" {
    for name in free grids; do
        local -n options=$name
        "$NEUPIG" run capture/points -o $name-whole "${small[@]}" "${options[@]}" >$name.log
        kill_at $name KILL 2 "${options[@]}"
        cp -r $name $name-cut
        printf '\x5a\xa5' | dd of="$(ls $name/job/window_*.vdb | tail -1)" bs=1 seek=3000 conv=notrunc status=none
        truncate -s $(($(last_record $name-cut/job/store.npg state) + 2000)) $name-cut/job/store.npg
        for out in $name $name-cut; do
            go_on $out "${options[@]}"
            [[ "$output" == *"is damaged"*"resumes from the window before"* ]]
            diff -r $name-whole/meshes $out/meshes
        done
    done
}

@test "without any state that is whole the job starts over" {
    cp -r broken none
    truncate -s 100 none/job/store.npg
    go_on none
    [[ "$output" == *"starts over"* ]]
    same none
}

@test "a changed option, input or result is named, and --restart discards" {
    cp -r whole changed
    run "$NEUPIG" run capture/points -o changed "${small[@]}" --method '{"epochs": 11}'
    echo "$output"
    [ "$status" -eq 2 ]
    [[ "$output" == *'option epochs was "10" and is "11"'*--restart* ]]
    cp -r capture/points other
    touch other/*
    run "$NEUPIG" run other -o changed "${small[@]}"
    [ "$status" -eq 0 ]
    cp other/frame_0005.ply other/frame_0004.ply
    run "$NEUPIG" run other -o changed "${small[@]}"
    [ "$status" -eq 2 ]
    [[ "$output" == *frame_0004.ply*--restart* ]]
    rm changed/meshes/frame_0002.ply
    run "$NEUPIG" run capture/points -o changed "${small[@]}"
    [ "$status" -eq 2 ]
    [[ "$output" == *frame_0002.ply*missing*--restart* ]]
    run "$NEUPIG" run capture/points -o changed "${small[@]}" --restart
    [ "$status" -eq 0 ]
    same changed
}

@test "an input that is exchanged while the run is on is named; put back, the run goes on" {
    cp -r capture/points exchanged
    "$NEUPIG" run exchanged -o torn "${small[@]}" --cache 0 >torn.log 2>&1 &
    local pid=$!
    while kill -0 $pid && [ ! -e torn/job/store.new ]; do sleep 0.01; done
    cp capture/points/frame_0005.ply next && mv next exchanged/frame_0000.ply
    status=0
    wait $pid || status=$?
    cat torn.log
    [ "$status" -eq 2 ]
    grep -q "exchanged/frame_0000.ply was exchanged while the run is on" torn.log
    [ ! -e torn/done.json ]
    cp capture/points/frame_0000.ply exchanged/
    "$NEUPIG" run exchanged -o torn "${small[@]}"
    diff -r whole/meshes torn/meshes
}

@test "a job of a version before the store is refused, and --restart discards it" {
    cp -r whole older
    sed -i '/"layout"/d' older/job/job.json
    mv older/job/store.npg older/job/window_000002.npg
    run "$NEUPIG" run capture/points -o older "${small[@]}"
    echo "$output"
    [ "$status" -eq 2 ]
    [[ "$output" == *"another version of neupig"*--restart* ]]
    "$NEUPIG" run capture/points -o older "${small[@]}" --restart
    [ "$(ls older/job)" = "$(ls whole/job)" ]
    same older
}

@test "a second run on the same job refuses" {
    cp -r whole twice
    exec 9>twice/job/lock
    flock 9
    run "$NEUPIG" run capture/points -o twice "${small[@]}" --restart
    flock -u 9
    exec 9>&-
    echo "$output"
    [ "$status" -eq 2 ]
    [[ "$output" == *"another run is at work"* ]]
    [ -e twice/done.json ]
    go_on twice
}

@test "a full disk ends with 5, and the run goes on when there is room" {
    unshare -rm true 2>/dev/null || skip "no file systems can be mounted here"
    mkdir -p disk
    # Room for the 256 KiB that a folder is tried with, beside what the job stores before it solves.
    size=$(du -sk --apparent-size whole | cut -f1)
    NEUPIG=$NEUPIG size=$size unshare -rm bash -ec '
        mount -t tmpfs -o size=$((2 * size / 3))k none disk
        status=0
        "$NEUPIG" run capture/points -o disk/full "$@" 2>disk.log || status=$?
        cat disk.log
        [ $status -eq 5 ]
        grep -q "No space left" disk.log
        grep -q NPGREC01state disk/full/job/store.npg
        mount -o remount,size=100m disk
        "$NEUPIG" run capture/points -o disk/full "$@"
        grep -q resumed_frames disk/full/report.json
        diff -r whole/meshes disk/full/meshes' bash "${small[@]}"
}

@test "append solves the frames that came later and leaves the old meshes alone" {
    mkdir growing
    cp capture/points/frame_000?.ply growing
    "$NEUPIG" run growing -o grown "${small[@]}"
    cp -r grown/meshes before
    run "$NEUPIG" append grown
    [ "$status" -eq 0 ]
    [[ "$output" == *"done already"* ]]
    cp capture/points/frame_001?.ply growing
    run "$NEUPIG" run growing -o grown "${small[@]}"
    [ "$status" -eq 2 ]
    [[ "$output" == *"2 frames more"*"neupig append"* ]]
    cp -r grown again
    "$NEUPIG" append grown
    [ "$(ls grown/meshes | wc -l)" -eq 12 ]
    [ "$(wc -l <grown/frames.jsonl)" -eq 12 ]
    grep -q '"frames": 12' grown/done.json
    for mesh in before/frame_000[0-7].ply; do cmp $mesh grown/meshes/"$(basename $mesh)"; done
    # broken off and started again it is the same
    "$NEUPIG" append again -q >again.log 2>&1 &
    pid=$!
    while kill -0 $pid 2>/dev/null && ! grep -q frame_0011 again/job/job.json; do sleep 0.02; done
    sleep 0.5
    kill -KILL $pid || true
    wait $pid || true
    "$NEUPIG" append again
    diff -r grown/meshes again/meshes
    cmp grown/frames.jsonl again/frames.jsonl
}

@test "a list of frames or a mesh that was changed in between is noticed" {
    cp -r broken list
    sed -i '1s/"index":[0-9]*/"index":99/' list/frames.partial.jsonl
    go_on list
    [[ "$output" == *frames.partial.jsonl* ]]
    same list
    cp -r broken mesh
    first=$(head -1 mesh/frames.partial.jsonl | sed 's/.*"file":"\([^"]*\)".*/\1/')
    printf 'x' | dd of="mesh/$first" bs=1 seek=300 conv=notrunc status=none
    run "$NEUPIG" run capture/points -o mesh "${small[@]}"
    echo "$output"
    [ "$status" -eq 3 ]
    [[ "$output" == *"$first"*--restart* ]]
}
