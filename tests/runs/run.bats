# The whole chain on a small capture: what a run leaves, that it is the same every time, how bad input ends.

small=(--method '{"epochs": 8, "poisson-depth": 5}' --faces 800 --bars flipped=5 --quiet)

setup_file() {
    cd "$BATS_FILE_TMPDIR"
    "$NEUPIG-bodies" --body bar --frames 5 --points 1200 -o capture >synth.log
    "$NEUPIG" run capture/points -o first "${small[@]}" --bars residual=100,coverage=0 >first.log
}

setup() {
    cd "$BATS_FILE_TMPDIR"
}

# A cloud of $2 points, coordinates by the awk expressions $3 $4 $5 of i, into $1.
cloud() {
    awk -v n="$2" "BEGIN {
        srand(7)
        print \"ply\nformat ascii 1.0\nelement vertex \" n \"\nproperty double x\nproperty double y\"
        print \"property double z\nend_header\"
        for (i = 0; i < n; i++) printf \"%.10g %.10g %.10g\n\", $3, $4, $5
    }" >"$1"
}

# run_bad STATUS WORD ARGUMENTS...: the run ends with the exit code, names the word, leaves no final name.
run_bad() {
    local expected=$1 word=$2
    shift 2
    rm -rf bad-out
    run "$NEUPIG" run "$@" -o bad-out "${small[@]}"
    echo "$output"
    [ "$status" -eq "$expected" ]
    [[ "$output" == *"$word"* ]]
    [ ! -e bad-out/done.json ]
    [ ! -e bad-out/frames.jsonl ]
    [ ! -e bad-out/report.json ]
}

@test "a run leaves one mesh per frame, the list, the report and at last the word that it is done" {
    [ "$(ls first/meshes | wc -l)" -eq 5 ]
    [ "$(wc -l <first/frames.jsonl)" -eq 5 ]
    grep -q '"status": "ok"' first/done.json
    grep -q '"meshes/frame_0004.ply"' first/done.json
    [ -s first/report.json ]
    [ -s first/reference.ply ]
    [ "$(ls -A first | grep -c '^\.')" -eq 0 ]
}

@test "every frame has the same faces, byte for byte" {
    faces=$(sed -n 's/^element face //p;/^end_header/q' first/reference.ply)
    [ "$faces" -gt 100 ]
    tail -c $((13 * faces)) first/reference.ply >faces
    for mesh in first/meshes/*.ply; do
        tail -c $((13 * faces)) "$mesh" | cmp - faces
    done
}

key_is() { # OUT INDEX
    python3 -c 'import json, sys
assert json.load(open(sys.argv[1] + "/report.json"))["stages"]["keyframe"]["key"]["index"] == int(sys.argv[2])' "$@"
}

@test "the keyframe of a mesh of one's own is the frame that it is nearest to, from files and live" {
    mesh=$(ls "$PWD"/capture/truth/* | sed -n 4p)
    own() { # from the end of its swing the bar is torn on its way to the other, which is said
        "$NEUPIG" run "$@" "${small[@]}" --bars residual=100,coverage=0 --reference "$mesh" || [ $? -eq 7 ]
    }
    own capture/points -o own
    key_is own 3
    cat capture/points/* | own - -o own-live
    key_is own-live 3
    cmp own/reference.ply own-live/reference.ply
}

@test "a helper process ends with the one that started it, also where that ended first" {
    helper=$(dirname "$NEUPIG")/neupig-poisson
    mkfifo held
    exec 4<>held
    run timeout 5 "$helper" 1 <&4 # of a process that is not its parent
    [ "$status" -eq 137 ]
    bash -c "'$helper' \$\$ <&4 & echo \$! >child; wait" &
    parent=$!
    while [ ! -s child ]; do sleep 0.01; done
    sleep 0.1
    works() { tr '\0' ' ' <"/proc/$(cat child)/cmdline" 2>/dev/null | grep -q poisson; } # one that nobody reaped has no words
    works
    kill -KILL $parent
    for try in {1..50}; do works || return 0; sleep 0.01; done
    false
}

@test "frames on standard input give the same meshes as the files" {
    "$NEUPIG" run capture/points -o from-files "${small[@]}" --bars residual=100,coverage=0 >/dev/null
    cat capture/points/*.ply | "$NEUPIG" run - -o piped "${small[@]}" --bars residual=100,coverage=0 >/dev/null
    for mesh in from-files/meshes/*.ply; do
        cmp "$mesh" "piped/meshes/$(basename "$mesh")"
    done
}

@test "a request to stop ends with 75 and nothing that looks done" {
    "$NEUPIG" run capture/points -o stopped "${small[@]}" --method '{"epochs": 1000000, "align": false, "width-1": 64, "width-2": 64}' --progress json >progress 2>stop.log &
    pid=$!
    while [ ! -e stopped/frames.partial.jsonl ]; do
        kill -0 $pid
        sleep 0.1
    done
    kill -TERM $pid
    status=0
    wait $pid || status=$?
    [ "$status" -eq 75 ]
    [ ! -e stopped/done.json ]
    [ ! -e stopped/frames.jsonl ]
}

@test "with keep-going a truncated frame is skipped, said, and the run ends with 7" {
    cp -r capture/points cut
    truncate -s 5000 cut/frame_0001.ply
    run "$NEUPIG" run cut -o cut-out "${small[@]}" --bars residual=100,coverage=0 --keep-going
    echo "$output"
    [ "$status" -eq 7 ]
    [[ "$output" == *frame_0001.ply* ]]
    grep -q '"exit_code": 7' cut-out/done.json
    sed -n 2p cut-out/frames.jsonl | grep -q '"skipped":true'
    run_bad 3 frame_0001.ply cut
}

@test "a missing, an empty and a gappy folder are bad input" {
    run_bad 3 nowhere nowhere
    mkdir -p nothing
    run_bad 3 nothing nothing
    cp -r capture/points gap
    rm gap/frame_0002.ply
    run_bad 3 "missing: 2" gap
}

@test "a file that can't be read is bad input" {
    cp -r capture/points locked
    rm locked/frame_0003.ply
    ln -s nowhere locked/frame_0003.ply
    run_bad 3 frame_0003.ply locked
}

@test "frames without a surface are bad input" {
    mkdir -p few equal plane
    for n in 0 1 3; do
        cloud few/frame_0.ply $n "rand()" "rand()" "rand()"
        run_bad 3 few/frame_0.ply few
    done
    cloud equal/frame_0.ply 500 1 2 3
    run_bad 3 equal/frame_0.ply equal
    cloud plane/frame_0.ply 500 "rand()" "rand()" 4
    run_bad 3 plane/frame_0.ply plane
}

@test "headers that lie are bad input" {
    mkdir -p lies
    for lie in "s/vertex [0-9]*/vertex 4000000000/" "s/vertex [0-9]*/vertex -5/" "s/vertex [0-9]*/vertex 99999999999999999999/" \
        "s/property float x/property quad x/" "s/property float x/property list uchar float x/" "s/^ply/plx/"; do
        sed "1,12$lie" capture/points/frame_0000.ply >lies/frame_0.ply
        run cmp -s lies/frame_0.ply capture/points/frame_0000.ply
        [ "$status" -eq 1 ]
        run_bad 3 lies/frame_0.ply lies
    done
}

@test "a keyframe that does not exist is wrong usage" {
    run_bad 2 "keyframe 99" capture/points --keyframe 99
}

@test "without a device a fit that needs one ends with 4" {
    OCL_ICD_VENDORS=/nonexistent run_bad 4 OpenCL capture/points --method '{"align": false}'
}

@test "an output that can't be written is 5, before any work" {
    touch a-file
    run "$NEUPIG" run capture/points -o a-file/out "${small[@]}"
    [ "$status" -eq 5 ]
    [[ "$output" == *a-file* ]]
    run "$NEUPIG" run capture/points -o /proc/neupig "${small[@]}"
    [ "$status" -eq 5 ]
}

@test "a file past the limit of the shell is a failed write, by name" {
    limited() { (ulimit -f 300; "$NEUPIG" run capture/points -o limited "${small[@]}" --export npz,usda); }
    run limited
    echo "$output"
    [ "$status" -eq 5 ]
    [[ "$output" == *"can't write limited/"*"File too large"* ]]
    [ ! -e limited/done.json ]
}

@test "too little memory is 6; what the process has beside the limit is said" {
    run_bad 6 "memory limit of 4 MiB" capture/points --max-memory 4
    run "$NEUPIG" run capture/points -o little "${small[@]}" --bars residual=100,coverage=0 --max-memory 30 --no-quiet
    [ "$status" -eq 0 ]
    [[ "$output" =~ "the process had "[0-9]+" MiB in memory, more than max-memory (30 MiB)" ]]
}

@test "a mesh of somebody else in the output folder is not lost" {
    mkdir -p foreign/meshes
    echo mine >foreign/meshes/frame_0000.ply
    run "$NEUPIG" run capture/points -o foreign "${small[@]}"
    echo "$output"
    [ "$status" -eq 2 ]
    [[ "$output" == *"foreign/meshes/frame_0000.ply is not of this job"*overwrite* ]]
    [ "$(cat foreign/meshes/frame_0000.ply)" = mine ]
    "$NEUPIG" run capture/points -o foreign "${small[@]}" --bars residual=100,coverage=0 --overwrite >/dev/null
}

@test "results of another numbering are not mixed in" {
    cp -r first mixed
    rm -r mixed/job
    cp mixed/meshes/frame_0000.ply mixed/meshes/frame_0077.ply
    run "$NEUPIG" run capture/points -o mixed "${small[@]}"
    [ "$status" -eq 2 ]
    [[ "$output" == *frame_0077.ply*overwrite* ]]
    [ -e mixed/done.json ]
}

@test "the memory formula holds" {
    total=$(sed -n 's/.*"total": \([0-9]*\).*/\1/p' first/report.json)
    peak=$(sed -n 's/.*"memory_peak_bytes": \([0-9]*\).*/\1/p' first/report.json)
    [ "$peak" -gt 1000000 ]
    [ "$peak" -le "$total" ]
}
