# verify: a byte that changed in a finished result is noticed by it, by a run that is asked again, by view and eval.

setup_file() {
    cd "$BATS_FILE_TMPDIR"
    "$NEUPIG-bodies" --body bar --frames 3 --points 500 -o capture >synth.log
    "$NEUPIG" run capture/points -o whole "${small[@]}" >whole.log
    cp -r whole flipped
    printf X | dd of=flipped/meshes/frame_0001.ply bs=1 seek=400 conv=notrunc 2>/dev/null
}

small=(--method '{"epochs": 8, "poisson-depth": 4}' --faces 400 --bars residual=100,coverage=0,flipped=100,stretched=100 --quiet)

setup() {
    cd "$BATS_FILE_TMPDIR"
}

@test "a result as it was written ends with 0, and so does what apply made of it" {
    "$NEUPIG" apply whole --mesh whole/reference.ply -o carried >/dev/null
    run "$NEUPIG" verify whole carried
    echo "$output"
    [ "$status" -eq 0 ]
    [ "$output" = $'whole: 6 files as they were written\ncarried: 3 files as they were written' ]
}

@test "a flipped byte and a file that is gone are named, exit code 3" {
    cp -r flipped both
    rm both/report.json
    run "$NEUPIG" verify whole both
    echo "$output"
    [ "$status" -eq 3 ]
    [[ "$output" == *"both/report.json is missing"* ]]
    [[ "$output" == *"both/meshes/frame_0001.ply was changed since it was written"* ]]
    run "$NEUPIG" verify capture whole
    [ "$status" -eq 3 ]
    [[ "$output" == *"capture is not done"*"whole: 6 files"* ]]
}

@test "a run that is asked again does not call a damaged result done" {
    run "$NEUPIG" run capture/points -o whole "${small[@]}"
    [ "$status" -eq 0 ]
    run "$NEUPIG" run capture/points -o flipped "${small[@]}"
    echo "$output"
    [ "$status" -eq 2 ]
    [[ "$output" == *"flipped/meshes/frame_0001.ply was changed"*--restart* ]]
}

@test "view and eval warn of it, and of nothing else" {
    run "$NEUPIG" eval flipped capture/truth --samples 100
    [[ "$output" == *"neupig eval: warning: flipped/meshes/frame_0001.ply was changed"* ]]
    run "$NEUPIG" eval whole capture/truth --samples 100
    [[ "$output" != *warning* ]]
    [ -e "$(dirname "$NEUPIG")/view/page.html" ] || skip "neupig view is not built"
    run "$NEUPIG" view flipped -o page.html
    [[ "$output" == *"neupig view: warning: flipped/meshes/frame_0001.ply was changed"* ]]
}
