# Every stage, and every way that results take, once and as short as can be: what the sanitizers and tests/run.sh --fast
# have of whole runs.  How good results are is for other tests; here a run ends as it should and leaves what it should.

load ../support/store

small=(--faces 500 --method '{"poisson-depth": 5, "align-nodes": 60, "align-steps": 5}' --bars residual=100,coverage=0,flipped=100,stretched=100,unsupported=100,invented=100
    --quiet)

setup_file() {
    cd "$BATS_FILE_TMPDIR"
    "$NEUPIG-bodies" --body bar --frames 6 --cycles 0.3 --points 500 --cell 0.05 --noise 0.2 --outliers 0.5 --no-normals \
        -o capture >synth.log
    "$NEUPIG" run capture/points -o out --method '{"window": 4, "overlap": 1}' --export ply,obj,pc2,glb,usda "${small[@]}"
}

setup() {
    cd "$BATS_FILE_TMPDIR"
}

# ended CODE COMMAND...: with that exit code
ended() {
    local wanted=$1
    shift
    run "$@"
    echo "$output"
    [ "$status" -eq "$wanted" ]
}

meshes() { # OUT COUNT
    [ -s "$1/done.json" ] && [ "$(ls "$1/meshes" | wc -l)" -eq "$2" ]
}

@test "points without normals, two windows, meshes in every form" {
    meshes out 6
    for name in motion.pc2 motion.glb motion.usda obj/frame_0005.obj reference.ply report.json frames.jsonl; do [ -s "out/$name" ]; done
    ended 0 "$NEUPIG" run capture/points -o out --method '{"window": 4, "overlap": 1}' --export ply,obj,pc2,glb,usda "${small[@]}" --no-quiet
    [[ "$output" == *"done already"* ]]
}

@test "report.json and done.json are what their schemas say, and no figure is without a word" {
    for name in report done; do
        "$NEUPIG" help $name --json >$name.schema
        python3 "$BATS_TEST_DIRNAME/check_schema.py" $name.schema out/$name.json
        "$NEUPIG" help $name | grep -q "^  files\[\].path  *in the folder$\|^  stages.mesh.vertices  *V$"
    done
    sed 's/"exit_code": [0-9]*/"exit_code": "none"/; s/"cores"/"kernels"/' out/report.json >wrong.json
    ended 1 python3 "$BATS_TEST_DIRNAME/check_schema.py" report.schema wrong.json
    [[ "$output" == *"exit_code: str"*"kernels: not in the schema"*"cores: missing"* ]]
}

@test "frames on standard input" {
    cat capture/points/* | "$NEUPIG" run - -o live --look-ahead 3 "${small[@]}"
    meshes live 6
}

@test "depth images of several sensors, with colours" {
    "$NEUPIG-bodies" --body bar --rig --cameras 3 --frames 3 --cycles 0.1 --width 80 --height 60 --cell 0.06 -o seen >>synth.log
    "$NEUPIG" run seen/rig -o rig "${small[@]}"
    meshes rig 3
    head -c 400 rig/reference.ply | grep -aq "property uchar red"
}

@test "a body that turns before one sensor" {
    "$NEUPIG-bodies" --body bar --cameras 1 --frames 4 --cycles 0.2 --width 48 --cell 0.06 -o side >>synth.log
    "$NEUPIG" run side/points -o grown "${small[@]}"
    meshes grown 4
}

@test "grids on the device" {
    "$NEUPIG" run capture/points -o grids --frames 0:3 "${small[@]}" \
        --method '{"align": false, "epochs": 2, "width-1": 32, "width-2": 32, "grid-levels": 3}'
    meshes grids 3
}

@test "an object that comes: segments" {
    "$NEUPIG-bodies" --body two --frames 10 --change 5 --points 500 --cell 0.06 --seed 2 -o two >>synth.log
    "$NEUPIG" run two/points -o two.out --segments auto --method '{"segment-min": 3}' --keyframe 2 "${small[@]}" --bars coverage=0 || [ $? -eq 7 ]
    [ -s two.out/segments.json ] && [ -s two.out/done.json ]
}

@test "killed and started again it goes on" {
    [ -e "$(dirname "$NEUPIG")/fault_shim.so" ] || skip "not under a sanitizer"
    killed_at state:1 "$NEUPIG" run capture/points -o killed --method '{"window": 2, "overlap": 1}' "${small[@]}" >killed.log 2>&1
    "$NEUPIG" run capture/points -o killed --method '{"window": 2, "overlap": 1}' "${small[@]}"
    meshes killed 6
}

@test "damaged, missing and impossible input is refused, or skipped on request" {
    cp -r capture/points bad
    truncate -s 2000 bad/frame_0001.ply
    ended 3 "$NEUPIG" run bad -o bad.out "${small[@]}"
    ended 7 "$NEUPIG" run bad -o bad.out --keep-going "${small[@]}"
    rm bad/frame_0002.ply
    ended 3 "$NEUPIG" run bad -o gap.out --keep-going "${small[@]}"
    ended 2 "$NEUPIG" run capture/points -o none --keyframe 99 "${small[@]}"
    ended 5 "$NEUPIG" run capture/points -o /proc/neupig "${small[@]}"
    ended 6 "$NEUPIG" run capture/points -o none --max-memory 4 "${small[@]}"
}

@test "what takes a result: apply, append, eval, render, view, batch" {
    "$NEUPIG" apply out --mesh out/reference.ply -o carried
    ended 0 "$NEUPIG" eval carried out/meshes --samples 1000
    [[ "$output" == *"Corr 0.00000"* ]]
    ended 0 "$NEUPIG" eval out capture --samples 1000
    "$NEUPIG" render out/meshes -o strip.png --count 3
    "$NEUPIG" probe capture/points >probe.txt || [ $? -eq 7 ]
    mkdir grows && cp capture/points/frame_000[0-3].ply grows
    "$NEUPIG" run grows -o longer "${small[@]}"
    cp capture/points/frame_000[45].ply grows
    "$NEUPIG" append longer
    meshes longer 6
    echo '{"output": "night", "defaults": {"faces": 500}, "captures": [
        {"input": "capture/points", "name": "one"}, {"input": "nowhere", "name": "two"}]}' >night.json
    ended 1 "$NEUPIG" batch night.json
    [ -s night/one/done.json ] && [ -s night/batch.json ]
}
