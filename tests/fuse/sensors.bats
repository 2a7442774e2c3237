# Where sensors stood (option --sensor) says what is empty: a slot that they looked through is not closed.

small=(--faces 2500 --unseen close --method '{"poisson-depth": 6, "align-nodes": 60, "align-steps": 6}' --keyframe 3 --no-outliers --quiet
    --bars unsupported=100,residual=100,coverage=0,flipped=100,stretched=100,invented=100)

setup_file() {
    cd "$BATS_FILE_TMPDIR"
    python3 "$BATS_TEST_DIRNAME/slotted_ball.py" slot
    "$NEUPIG" run slot/points -o closed --sensor none "${small[@]}"
    "$NEUPIG" run slot/points -o open --sensor slot/sensors.txt "${small[@]}"
}

setup() {
    cd "$BATS_FILE_TMPDIR"
}

# The least height of the slot's floor near its middle (the ball of the keyframe 3 stands at x = 0.15): floor RUN
floor_of() {
    PYTHONPATH="$BATS_TEST_DIRNAME/../support" python3 - "$1/reference.ply" <<'P'
import sys
from plain_files import read_mesh
vertices, faces = read_mesh(sys.argv[1])
least, parts = 9, 16  # what spans nothing may have large faces: all over each
for face in faces:
    corners = [[vertices[v][axis] for v in face] for axis in "xyz"]
    for i in range(parts + 1):
        for j in range(parts + 1 - i):
            x, y, z = (a + (b - a) * i / parts + (c - a) * j / parts for a, b, c in corners)
            if abs(x - 0.15) < 0.1 and abs(y) < 0.5 and z > 0:
                least = min(least, z)
print(least)
P
}

# report RUN KEY: of stage mesh
report() {
    sed -n 's/.*"'"$2"'": \([0-9.e+-]*\).*/\1/p' "$1/report.json"
}

@test "what sensors looked through is open" {
    echo "floors: $(floor_of closed) $(floor_of open)"
    awk -v closed="$(floor_of closed)" -v open="$(floor_of open)" 'BEGIN { exit !(closed > 0.6 && open < closed - 0.2) }'
    [ "$(report open vertices_pushed)" -gt 50 ]
    [ "$(report open cells_seen_empty)" -gt 1000 ]
    awk -v was="$(report open seen_empty_share)" -v left="$(report open seen_empty_left_share)" \
        'BEGIN { exit !(was > 0.03 && left < 0.7 * was) }'
}

@test "where nobody says where they stood the points do, but for --sensor none" {
    [ -z "$(report closed seen_empty_share)" ]
    [ -z "$(report closed vertices_pushed)" ]
    "$NEUPIG" run slot/points -o found "${small[@]}"
    [ "$(report found cells_seen_empty)" -gt 1000 ]
    awk -v was="$(report found seen_empty_share)" -v left="$(report found seen_empty_left_share)" \
        'BEGIN { exit !(left <= was) }'
}

@test "sensors that see no slot leave it closed" {
    # from the sides the ball hides it, but for the lines past its top
    "$NEUPIG" run slot/points -o beside --sensor 60,0,-20:-60,0,-20 "${small[@]}"
    echo "floor: $(floor_of beside)"
    awk -v floor="$(floor_of beside)" 'BEGIN { exit !(floor > 0.6) }'
}

@test "a file of places that is none is refused, with its line" {
    printf '0 1 2 3\n1 2 3\n' >bad.txt
    run "$NEUPIG" run slot/points -o bad --sensor bad.txt "${small[@]}"
    echo "$output"
    [ "$status" -eq 3 ]
    [[ "$output" == *"bad.txt"*"line 2"* ]]
    printf '0 1 2 3\n1 1 2 3\n' >short.txt
    run "$NEUPIG" run slot/points -o short --sensor short.txt "${small[@]}"
    echo "$output"
    [ "$status" -eq 3 ]
    [[ "$output" == *"no place of a sensor for frame 2"* ]]
    run "$NEUPIG" run slot/points -o none-such --sensor no/such/file "${small[@]}"
    echo "$output"
    [ "$status" -eq 2 ]
    [[ "$output" == *"option sensor"* ]]
}

@test "a job that was begun with another file of places is another job" {
    printf '0 0 60\n0 0 60\n' >places.txt
    "$NEUPIG" run slot/points -o same --sensor places.txt "${small[@]}" --frames 2:4
    run "$NEUPIG" run slot/points -o same --sensor places.txt "${small[@]}" --frames 2:4
    [ "$status" -eq 0 ]
    printf '0 0 61\n0 0 60\n' >places.txt
    run "$NEUPIG" run slot/points -o same --sensor places.txt "${small[@]}" --frames 2:4
    echo "$output"
    [ "$status" -eq 2 ]
    [[ "$output" == *"the file of option sensor is not the one it was"* ]]
}
