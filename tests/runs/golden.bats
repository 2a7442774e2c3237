# A small golden sequence end to end: from its points to a moving mesh near the truth.

setup_file() {
    cd "$BATS_FILE_TMPDIR" || return 1
    "$NEUPIG-bodies" -o capture --body bar --frames 5 --points 1500 --cell 0.05 --cycles 0.4 >/dev/null
}

setup() {
    cd "$BATS_TEST_TMPDIR" || return 1
    capture="$BATS_FILE_TMPDIR/capture"
    small=(--method '{"epochs": 30, "poisson-depth": 6}' --faces 1500 --quiet)
}

@test "the whole way: meshes with the same faces near the truth, reports, done.json last" {
    # shellcheck disable=SC2086
    "$NEUPIG" run "$capture/points" -o out "${small[@]}" --bars residual=5
    for name in reference.ply report.json frames.jsonl done.json; do [ -s out/$name ]; done
    [ "$(ls out/meshes)" = "$(printf 'frame_%04d.ply\n' 0 1 2 3 4)" ]
    [ "$(wc -l <out/frames.jsonl)" -eq 5 ]
    run "$NEUPIG" eval out "$capture"
    [ "$status" -eq 0 ]
    [[ "$output" == *"constant topology yes"* ]]
    cd=$(sed -n 's/^frames 5  CD \([0-9.]*\).*/\1/p' <<<"$output")
    awk -v cd="$cd" 'BEGIN { exit !(cd > 0 && cd < 60) }'
}

@test "a key of a solver that the run does not use is refused" {
    run "$NEUPIG" run "$capture/points" -o out "${small[@]}" --method '{"width-1": 64}'
    echo "$output"
    [ "$status" -eq 2 ]
    [[ "$output" == *"key width-1 of the method has no effect: this run's solver is joint"* ]]
    run "$NEUPIG" run "$capture/points" -o out "${small[@]}" --method '{"align": false, "joint-shape": 1}'
    [ "$status" -eq 2 ]
    [[ "$output" == *"key joint-shape of the method has no effect: this run's solver is paper"* ]]
}

@test "the same input, options and seed give the same bytes" {
    for i in 1 2; do
        # shellcheck disable=SC2086
        "$NEUPIG" run "$capture/points" -o $i "${small[@]}" --frames 0:3 --method '{"epochs": 5}' || [ $? -eq 7 ]
    done
    diff -r 1/meshes 2/meshes
    cmp 1/reference.ply 2/reference.ply
}
