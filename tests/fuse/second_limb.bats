# A limb that the motion of a frame does not find is not added for the second time: the reference stays as the keyframe
# shows the body, and the frames are bad.

setup_file() {
    cd "$BATS_FILE_TMPDIR"
    python3 "$BATS_TEST_DIRNAME/thrown_arm.py" figure
}

# The share of the vertices of MESH.ply to the right of where the arm hangs: beyond MESH.ply
beyond() {
    python3 - "$1" <<'P'
import struct, sys
head, body = open(sys.argv[1], "rb").read().split(b"end_header\n", 1)
lines = head.decode().split("\n")
count = int(next(l for l in lines if l.startswith("element vertex")).split()[2])
fields = [l for l in lines[: next(i for i, l in enumerate(lines) if "element face" in l)] if l.startswith("property")]
size = sum(1 if "char" in l else 4 for l in fields)
print(sum(struct.unpack_from("<f", body, size * v)[0] > 0.42 for v in range(count)) / count)
P
}

@test "an arm that is thrown to the side does not become a third one" {
    cd "$BATS_FILE_TMPDIR"
    run "$NEUPIG" run figure/rig.json -o out --keyframe 2 --faces 2500 --quiet --method '{"poisson-depth": 6}'
    echo "$output"
    [ "$status" -eq 7 ]
    echo "beyond: $(beyond out/reference.ply)"
    [ "$(beyond out/reference.ply)" = 0.0 ]
    [ "$(grep -c '"good":false' out/frames.jsonl)" -eq 6 ] # the arm is lost in them
    ! head -n 6 out/frames.jsonl | grep -q '"good":false'
}

@test "no pixel of an image is isolated" {
    cd "$BATS_FILE_TMPDIR"
    [ "$(grep -c '"isolated":0' out/frames.jsonl)" -eq 12 ]
}
