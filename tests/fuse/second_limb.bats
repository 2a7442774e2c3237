# A limb that the motion of a frame does not find is not added for the second time: the reference stays as the keyframe
# shows the body, and the frames are bad.

setup_file() {
    cd "$BATS_FILE_TMPDIR"
    python3 "$BATS_TEST_DIRNAME/thrown_arm.py" figure
}

# The share of the vertices of MESH.ply to the right of where the arm hangs: beyond MESH.ply
beyond() {
    PYTHONPATH="$BATS_TEST_DIRNAME/../support" python3 - "$1" <<'P'
import sys
from plain_files import read_vertices
vertices = read_vertices(sys.argv[1])
print(sum(v["x"] > 0.42 for v in vertices) / len(vertices))
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
