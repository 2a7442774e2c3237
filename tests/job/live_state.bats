# Live runs that are killed (-9) and started again: a folder that is followed, standard input.  Pushed frames:
# test_push_resume.c.

load ../support/store

small=(--method '{"epochs": 2, "poisson-depth": 4, "align-nodes": 40,
                  "align-steps": 6}' --faces 300 --quiet --bars residual=100,coverage=0,stretched=100,flipped=100)
open=(--method '{"window": 4, "overlap": 1}' --look-ahead 6 --follow-end 0)

setup_file() {
    cd "$BATS_FILE_TMPDIR"
    "$NEUPIG-bodies" --body bar --frames 14 --points 400 -o capture >synth.log
    cat capture/points/*.ply >stream
    cp -r capture/points all
    : >all/capture.end
    "$NEUPIG" run --follow all -o whole "${small[@]}" "${open[@]}" >whole.log
}

setup() {
    cd "$BATS_FILE_TMPDIR"
}

# What the run into $2 has must be that of $1, byte by byte, but for the folder that the frames lay in.
same() {
    cmp "$1/reference.ply" "$2/reference.ply"
    for run in "$1" "$2"; do sed 's/"source":"[^"]*"//' "$run/frames.jsonl" >"$run.frames"; done
    cmp "$1.frames" "$2.frames"
    diff -r "$1/meshes" "$2/meshes"
}

# A run over folder $1, left alone, and one that is killed at the states $2; then their options.
check_killed() {
    local folder=$1 states=$2 state wanted=0 status=0
    shift 2
    rm -rf left killed
    "$NEUPIG" run --follow "$folder" -o left "${small[@]}" "$@" >left.log 2>&1 || wanted=$?
    for state in $states; do
        killed_at "state:$state" "$NEUPIG" run --follow "$folder" -o killed "${small[@]}" "$@" >killed.log 2>&1
    done
    "$NEUPIG" run --follow "$folder" -o killed "${small[@]}" "$@" >killed.log 2>&1 || status=$?
    cat killed.log
    [ "$status" -eq "$wanted" ]
    grep -q '"resumed_frames": [1-9]' killed/report.json
    same left killed
}

@test "a folder that grows while the run is killed three times gives the same bytes" {
    mkdir grows
    local fed=0 run
    for step in "7 0" "10 1" "13 3"; do
        set -- $step
        for file in $(ls capture/points | head -"$1" | tail -n +$((fed + 1))); do cp "capture/points/$file" grows; done
        fed=$1
        killed_at state:$2 "$NEUPIG" run --follow grows -o grown "${small[@]}" "${open[@]}" >grown.log 2>&1
        mkdir -p before && cp -n grown/meshes/*.ply before/ 2>/dev/null || true
    done
    [ "$(ls before | wc -l)" -ge 4 ]
    cp capture/points/*.ply grows
    : >grows/capture.end
    run "$NEUPIG" run --follow grows -o grown "${small[@]}" "${open[@]}" --no-quiet
    echo "$output"
    [ "$status" -eq 0 ]
    [[ "$output" == *"resumes an earlier run: "*" frames are solved and "*" written"* ]]
    same whole grown
    for mesh in before/*; do cmp "$mesh" "grown/meshes/$(basename "$mesh")"; done
}

@test "windows before the keyframe, a source that ends inside the first window or inside the look-ahead" {
    check_killed all "0 2" --method '{"window": 4, "overlap": 2}' --look-ahead 11 --keyframe 8
    check_killed all "0" --method '{"window": 9, "overlap": 2}' --look-ahead 12 --keyframe 10
    check_killed all "0 1" --method '{"window": 4, "overlap": 2}' --look-ahead 40
}

@test "grids over aligned poses: killed at two states it gives the same bytes" {
    check_killed all "0 1" "${open[@]}" --method '{"preset": "grids", "width-1": 32, "width-2": 32, "grid-levels": 3}'
    grep -q '"solver": "grids"' killed/report.json
}

@test "gaps, a file that can't be read, and a selection" {
    mkdir gaps
    cp all/* gaps
    rm gaps/frame_000[47].ply gaps/frame_0010.ply
    head -c 2000 all/frame_0009.ply >gaps/frame_0009.ply
    touch gaps/capture.end
    for missing in hold skip; do
        check_killed gaps "0 2" "${open[@]}" --method '{"follow-settle": 0}' --keep-going --missing $missing
    done
    check_killed gaps "0" "${open[@]}" --look-ahead 4 --method '{"follow-settle": 0, "window": 3}' --keep-going --missing skip --frames 1::2
}

@test "without alignment it is killed inside a window" {
    local free=(--method '{"align": false, "width-1": 32, "width-2": 32, "grid-levels": 3, "epochs": 400}')
    rm -rf left killed
    "$NEUPIG" run --follow all -o left "${small[@]}" "${open[@]}" "${free[@]}" >left.log
    # in the first window, behind it, and in the second: the first state inside is due at once in each process
    for record in inside:-1 state:0 inside:0; do
        killed_at $record "$NEUPIG" run --follow all -o killed "${small[@]}" "${open[@]}" "${free[@]}" >killed.log 2>&1
    done
    "$NEUPIG" run --follow all -o killed "${small[@]}" "${open[@]}" "${free[@]}"
    grep -q '"resumed_frames": [1-9]' killed/report.json
    same left killed
}

@test "a stream that begins again is compared and goes on; another one is refused" {
    killed_at state:1 "$NEUPIG" run - -o streamed "${small[@]}" "${open[@]}" <stream >streamed.log 2>&1
    cp -r streamed other
    "$NEUPIG" run - -o streamed "${small[@]}" "${open[@]}" <stream
    grep -q '"resumed_frames": [1-9]' streamed/report.json
    diff -r whole/meshes streamed/meshes
    run "$NEUPIG" run - -o other "${small[@]}" "${open[@]}" < <(cat $(ls capture/points/*.ply | tail -n +2))
    echo "$output"
    [ "$status" -eq 2 ]
    [[ "$output" == *"other holds another job: frame 0 of standard input is not the one it was"*--restart* ]]
    run "$NEUPIG" run - -o other "${small[@]}" "${open[@]}" < <(cat capture/points/frame_000[0-3].ply)
    [ "$status" -eq 2 ]
    [[ "$output" == *"frame 4 of standard input does not come any more"* ]]
    run "$NEUPIG" run --follow all -o other "${small[@]}" "${open[@]}"
    [ "$status" -eq 2 ]
    [[ "$output" == *"another kind of source (follow)"*"(stream)"* ]]
    "$NEUPIG" run - -o other "${small[@]}" "${open[@]}" --restart <stream
    diff -r whole/meshes other/meshes
    # one that is done is as it always was
    run "$NEUPIG" run - -o other "${small[@]}" "${open[@]}" <stream
    [ "$status" -eq 2 ]
    [[ "$output" == *"set overwrite"* ]]
    "$NEUPIG" run - -o other "${small[@]}" "${open[@]}" --overwrite <stream
}

@test "a changed option is named; files of frames that came may change, or go" {
    local far=(--method '{"window": 4, "overlap": 2}' --look-ahead 12 --keyframe 9 --follow-end 0) # frame 0 is solved in window 4
    "$NEUPIG" run --follow all -o far "${small[@]}" "${far[@]}" >far.log
    cp -r capture/points changing
    killed_at state:0 "$NEUPIG" run --follow changing -o change "${small[@]}" "${far[@]}" >change.log 2>&1
    : >changing/capture.end
    run "$NEUPIG" run --follow changing -o change "${small[@]}" "${far[@]}" --method '{"epochs": 3}'
    echo "$output"
    [ "$status" -eq 2 ]
    [[ "$output" == *'option epochs was "2" and is "3"'*--restart* ]]
    cp changing/frame_0003.ply changing/frame_0000.ply
    rm changing/frame_0009.ply
    "$NEUPIG" run --follow changing -o change "${small[@]}" "${far[@]}" --follow-end 9
    same far change
}

@test "a followed folder that is done says so, and when files came since" {
    cp -r all later
    cp -r whole finished
    run "$NEUPIG" run --follow later -o finished "${small[@]}" "${open[@]}" --no-quiet
    echo "$output"
    [ "$status" -eq 0 ]
    [[ "$output" == *"done already"* ]]
    cp all/frame_0013.ply later/frame_0014.ply
    run "$NEUPIG" run --follow later -o finished "${small[@]}" "${open[@]}"
    [ "$status" -eq 2 ]
    [[ "$output" == *"is done, but 1 files came since"*--restart* ]]
    run "$NEUPIG" append finished
    [ "$status" -eq 2 ]
    [[ "$output" == *"not to one of a live source"* ]]
}

@test "append brings a followed folder that was broken off to its end" {
    killed_at state:1 "$NEUPIG" run --follow all -o ended "${small[@]}" "${open[@]}" >ended.log 2>&1
    run "$NEUPIG" append ended -q
    [ "$status" -eq 2 ]
    same whole ended
}

@test "damaged frames that came are said, and the job starts over" {
    killed_at state:0 "$NEUPIG" run --follow all -o hurt "${small[@]}" "${open[@]}" >hurt.log 2>&1
    printf x | dd of=hurt/job/frames.npg bs=1 seek=$(($(grep -abo NPGREC01frame hurt/job/frames.npg | sed -n 2p | cut -d: -f1) + 100)) \
        conv=notrunc status=none
    rm -rf hurt/meshes
    run "$NEUPIG" run --follow all -o hurt "${small[@]}" "${open[@]}"
    echo "$output"
    [ "$status" -eq 0 ]
    [[ "$output" == *"frames.npg is damaged: the record at byte "*"starts over"* ]]
    same whole hurt
}

@test "a full disk ends with 5, and the run goes on when there is room" {
    unshare -rm true 2>/dev/null || skip "no file systems can be mounted here"
    mkdir -p disk
    # Half a MiB of OpenVDB a frame: the disk is full after some frames, not while the folder is tried with 256 KiB.
    NEUPIG=$NEUPIG unshare -rm bash -ec '
        mount -t tmpfs -o size=3m none disk
        status=0
        "$NEUPIG" run --follow all -o disk/full --export vdb "$@" 2>disk.log || status=$?
        cat disk.log
        [ $status -eq 5 ]
        grep -q "No space left" disk.log
        grep -q NPGREC01state disk/full/job/store.npg
        mount -o remount,size=100m disk
        "$NEUPIG" run --follow all -o disk/full --export vdb "$@"
        grep -q resumed_frames disk/full/report.json
        diff -r whole/meshes disk/full/meshes' bash "${small[@]}" "${open[@]}"
}
