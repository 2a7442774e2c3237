# The small programs of samples/, run as they stand.

setup_file() {
    cd "$BATS_FILE_TMPDIR"
    "$NEUPIG-bodies" --body bar --frames 3 --points 800 -o capture >synth.log
}

setup() {
    cd "$BATS_FILE_TMPDIR"
    samples=$(dirname "$NEUPIG")
}

# run_for CODES COMMAND...: it ends with one of the exit codes.
run_for() {
    local codes=$1
    shift
    run "$@"
    echo "$output"
    [[ " $codes " == *" $status "* ]]
}

@test "a whole run in one call" {
    run_for "0 7" "$samples/sample_run_folder" capture/points out epochs=5 faces=500
    [[ "$output" == *"100 %"* ]]
    [ "$(ls out/meshes | wc -l)" -eq 3 ]
    [ -s out/done.json ]
    run_for 2 "$samples/sample_run_folder" capture/points out nonsense=1
    [[ "$output" == *"there is no option nonsense"* ]]
    run_for 3 "$samples/sample_run_folder" nowhere out2
}

@test "pushing frames and pulling meshes" {
    run_for "0 7" "$samples/sample_push_pull" 4
    [ "$(grep -c '^frame .* vertices' <<<"$output")" -eq 4 ]
    [[ "$output" == *"frame 3: "*"middle at x = 431000.0"* ]]
}

# The highest vertex, as the sample says it.
highest() { sed -n 's/.*highest vertex at y = //p' <<<"$output"; }

@test "stages of one's own see what they should and take points away" {
    run_for "0 7" "$samples/sample_custom_stage" capture/points own 0
    [[ "$output" == "3 frames, "*  || "$output" == *$'\n'"3 frames, "* ]]
    awk -v y="$(highest)" 'BEGIN { exit !(y > 0.5 && y < 1.5) }'
    dropped=$(grep -A 3 '"floor": {' own/report.json | sed -n 's/.*"points_dropped": \([0-9]*\).*/\1/p')
    [ "$dropped" -gt 100 ]
    # what remains lies above the floor, but for the surface's slack (in other frames than its own nothing holds
    # the end that the floor took)
    "$NEUPIG" probe own/reference.ply --json >probe.json || [ $? -eq 7 ]
    awk '/"low"/ { getline; getline; exit !($1 + 0 > -0.3) }' probe.json
    grep -q '"custom_stages":' own/job/job.json
}

@test "a run does not go on from one with other stages" {
    run_for "0 7" "$samples/sample_custom_stage" capture/points again -5
    run_for 2 "$NEUPIG" run capture/points -o again --method '{"epochs": 10}' --faces 800
    [[ "$output" == *"the stages that the program added"* ]]
    run_for "0 7" "$samples/sample_custom_stage" capture/points again -5
}

@test "a stage that finds nothing left ends the run with its name" {
    run_for 3 "$samples/sample_custom_stage" capture/points none 1000
    [ ! -e none/done.json ]
}

@test "the nearest surface point" {
    run_for 0 "$samples/sample_nearest"
    [[ "$output" == *"after the move"* ]]
}
