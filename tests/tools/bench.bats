# bench: every part has a row, and only what is asked for is timed.  What is timed here is never judged.

SMALL=(--vertices 2500 --points 300 --frames 2 --repeat 1)

@test "bench prints a row for every part, as a table and as JSON" {
    run "$NEUPIG" bench "${SMALL[@]}"
    [ "$status" -eq 0 ]
    [[ "$output" == *tuning*"2216 vertices, 300 points, 2 frames"*"processor ms"* ]]
    for row in mlp_forward mlp_backward transform nearest isometry closest track joint poisson; do
        grep -qE "^$row +[0-9.]+ +[0-9.]+$" <<<"$output"
    done
    run "$NEUPIG" bench "${SMALL[@]}" --only mlp --json
    [ "$status" -eq 0 ]
    for word in version sizes vertices rows mlp_forward mlp_backward device tuning; do
        [ "$(grep -c "\"$word\":" <<<"$output")" -eq 1 ]
    done
    [ "$(grep -c '"wall_s"' <<<"$output")" -eq 2 ]
}

@test "bench needs a device for its kernels alone, and says when nothing is left to time" {
    run "$NEUPIG" bench "${SMALL[@]}" --only closest --device nowhere
    [ "$status" -eq 0 ]
    [[ "$output" == *closest* ]]
    run "$NEUPIG" bench "${SMALL[@]}" --only mlp --device nowhere
    [ "$status" -eq 4 ]
    run "$NEUPIG" bench "${SMALL[@]}" --only nothing
    [ "$status" -eq 2 ]
    [[ "$output" == *nothing* ]]
}
