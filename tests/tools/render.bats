# render: pictures without a display.

setup() {
    cd "$BATS_TEST_TMPDIR" || return 1
    "$NEUPIG-bodies" -o s --body bar --frames 5 --points 500 --cell 0.05 >/dev/null
    unset DISPLAY
}

# Width and height in a PNG's header.
size_of() { od -An -tu1 -j16 -N8 "$1" | awk '{ print $3 * 256 + $4, $7 * 256 + $8 }'; }

@test "a mesh, a cloud and a strip" {
    "$NEUPIG" render s/truth/frame_0000.ply -o mesh.png --height 100 --width 80
    [ "$(size_of mesh.png)" = "80 100" ]
    [ "$(od -An -tx1 -N4 mesh.png)" = " 89 50 4e 47" ]
    "$NEUPIG" render s/points/frame_0000.ply -o cloud.png --height 100 --width 80
    run cmp -s mesh.png cloud.png
    [ "$status" -eq 1 ]
    "$NEUPIG" render s/truth -o strip.png --height 50 --width 40
    [ "$(size_of strip.png)" = "200 50" ]
    "$NEUPIG" render s/truth -o rows.png --height 50 --width 40 --count 3 --columns 2
    [ "$(size_of rows.png)" = "80 100" ]
}

@test "the same bytes every time, others from another side or in other colours" {
    for i in 1 2; do "$NEUPIG" render s/truth/frame_0001.ply -o $i.png --height 60; done
    cmp 1.png 2.png
    for option in "--view left" "--view top" "--colour normal" "--colour identity" "--up z"; do
        # shellcheck disable=SC2086
        "$NEUPIG" render s/truth/frame_0001.ply -o other.png --height 60 $option
        run cmp -s 1.png other.png
        [ "$status" -eq 1 ]
    done
}

@test "the frames of a rig, in their colours" {
    "$NEUPIG" synth -o r --rig --cameras 2 --frames 4 --width 80 --height 60 >/dev/null
    "$NEUPIG" render r/rig/rig.json -o strip.png --height 50 --width 40
    [ "$(size_of strip.png)" = "160 50" ]
    "$NEUPIG" render r/rig/rig.json -o one.png --height 50 --count 1
    "$NEUPIG" render 'r/rig/rig.json#2' -o two.png --height 50
    cmp one.png two.png
    "$NEUPIG" render r/rig/rig.json -o plain.png --height 50 --count 1 --colour plain
    run cmp -s one.png plain.png
    [ "$status" -eq 1 ]
    run "$NEUPIG" render 'r/rig/rig.json#9' -o none.png
    [ "$status" -eq 3 ]
    [[ "$output" == *"rig.json#9: the rig has no such frame"* ]]
}

@test "a rig in the camera's own axes is drawn upright" {
    "$NEUPIG" synth -o r --rig --cameras 1 --frames 1 --width 80 --height 60 >/dev/null
    python3 -c '
import json, sys
rig = json.load(open(sys.argv[1]))
for sensor in rig["sensors"]: del sensor["pose"]
json.dump(rig, open(sys.argv[2], "w"))
for sensor in rig["sensors"]: sensor["pose"] = [0, -1, 0, 0, -1, 0, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1]
json.dump(rig, open(sys.argv[3], "w"))' r/rig/rig.json r/rig/own.json r/rig/lying.json
    "$NEUPIG" render r/rig/own.json -o auto.png --height 50
    "$NEUPIG" render r/rig/own.json -o down.png --height 50 --up -y
    cmp auto.png down.png
    "$NEUPIG" render r/rig/own.json -o y.png --height 50 --up y
    run cmp -s auto.png y.png
    [ "$status" -eq 1 ]
    "$NEUPIG" probe r/rig/own.json | grep '^up  *-y, as the sensors stand; run --axes x-y-z'
    "$NEUPIG" probe r/rig/rig.json | grep '^up  *y, as the sensors stand$'
    # a camera that lies says no more than that up is across its images
    "$NEUPIG" probe r/rig/lying.json | grep '^up  *y, as the sensors stand$'
}

@test "what a run has made of such a rig is drawn upright, by any name" {
    "$NEUPIG" synth -o s --rig --cameras 1 --frames 2 --width 80 --height 60 >/dev/null
    python3 -c '
import json, sys
rig = json.load(open(sys.argv[1]))
for sensor in rig["sensors"]: del sensor["pose"]
json.dump(rig, open(sys.argv[2], "w"))' s/rig/rig.json s/rig/own.json
    draw() { # FILES, from FOLDER: as with --up -y, unless another is named
        (cd "$1" && "$NEUPIG" render "$2" -o "$PWD/auto.png" --height 50 && "$NEUPIG" render "$2" -o "$PWD/up.png" --height 50 --up "${3:--y}")
        cmp "$1/auto.png" "$1/up.png"
        rm "$1/auto.png" "$1/up.png"
    }
    "$NEUPIG" run s/rig/own.json -o down --effort quick --faces 1000 -q
    draw . down/meshes
    draw down reference.ply
    draw down meshes/frame_0001.ply
    draw down/meshes frame_0001.ply
    # results with axes of their own have y up
    "$NEUPIG" run s/rig/own.json -o turned --effort quick --faces 1000 --axes x-y-z -q
    draw . turned/meshes y
    # the page does, too, and has the points of the images
    "$NEUPIG" view down
    grep -q '"up":"-y"' down/view.html
    cp -r down part # as if the run were at work
    rm part/report.json part/done.json
    "$NEUPIG" view part
    grep -q '"up":"-y"' part/view.html
    run "$NEUPIG" view down
    echo "$output"
    [[ "$output" != *"without points"* ]]
}

@test "colours in the file are shown" {
    printf 'ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n' >c.ply
    printf 'property uchar red\nproperty uchar green\nproperty uchar blue\nelement face 1\n' >>c.ply
    printf 'property list uchar int vertex_indices\nend_header\n' >>c.ply
    printf '0 0 0 255 0 0\n1 0 0 255 0 0\n0 1 0 255 0 0\n3 0 1 2\n' >>c.ply
    "$NEUPIG" render c.ply -o red.png --height 40 --colour vertex
    "$NEUPIG" render c.ply -o plain.png --height 40
    run cmp -s red.png plain.png
    [ "$status" -eq 1 ]
}

@test "what can't be drawn or written ends with its exit code and leaves no picture" {
    run "$NEUPIG" render s/truth
    [ "$status" -eq 2 ]
    run "$NEUPIG" render nowhere.ply -o a.png
    [ "$status" -eq 3 ]
    head -c 2000 s/truth/frame_0000.ply >cut.ply
    run "$NEUPIG" render cut.ply -o a.png
    [ "$status" -eq 3 ]
    [[ "$output" == *"cut.ply"* ]]
    [ ! -e a.png ]
    run "$NEUPIG" render s/truth/frame_0000.ply -o s/truth/frame_0000.ply/a.png --height 20
    [ "$status" -eq 5 ]
}
