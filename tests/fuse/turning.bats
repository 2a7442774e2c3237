# A body that turns before one sensor: the reference grows from the side that the keyframe
# saw to the whole body, whose vertices turn with it.

small=(--faces 3000 --method '{"align-nodes": 200, "poisson-depth": 6}' --no-outliers --quiet --keyframe 6
    --bars residual=100,coverage=0,flipped=100,stretched=100,unsupported=100,invented=100)

setup_file() {
    cd "$BATS_FILE_TMPDIR"
    python3 "$BATS_TEST_DIRNAME/turning_body.py" body
    "$NEUPIG" run body/points -o grown --sensor body/sensor.txt "${small[@]}"
}

setup() {
    cd "$BATS_FILE_TMPDIR"
}

@test "the whole body is there, and its vertices turn with it" {
    read -r slide share < <(python3 "$BATS_TEST_DIRNAME/turning_body.py" --slide grown 6)
    read -r slide_key share_key < <(
        "$NEUPIG" run body/points -o key --sensor body/sensor.txt "${small[@]}" --method '{"reference-from": "key"}' >/dev/null || true
        python3 "$BATS_TEST_DIRNAME/turning_body.py" --slide key 6)
    echo "grown: slide $slide, share $share; from the keyframe: $slide_key, $share_key"
    awk -v s="$slide" -v w="$share" -v k="$share_key" 'BEGIN { exit !(s < 0.01 && w > 0.95 && k < 0.8) }'
}

@test "killed while it grows, it goes on to the same bytes" {
    local pid
    rm -rf killed
    "$NEUPIG" run body/points -o killed --sensor body/sensor.txt "${small[@]}" --log-file killed.log &
    pid=$!
    until grep -q "it grows" killed.log 2>/dev/null; do
        kill -0 $pid
        sleep 0.02
    done
    kill -KILL $pid
    wait $pid || true
    "$NEUPIG" run body/points -o killed --sensor body/sensor.txt "${small[@]}"
    cmp grown/reference.ply killed/reference.ply
    for mesh in grown/meshes/*.ply; do cmp "$mesh" "killed/meshes/${mesh##*/}"; done
}

@test "a sensor whose place nobody says is found" {
    "$NEUPIG" run body/points -o found --log-file found.log "${small[@]}"
    grep -q "look like one view" found.log
    read -r slide share < <(python3 "$BATS_TEST_DIRNAME/turning_body.py" --slide found 6)
    echo "slide $slide, share $share"
    awk -v s="$slide" -v w="$share" 'BEGIN { exit !(s < 0.01 && w > 0.95) }'
}
