# Rigs, the whole way: depth and colour images -> points -> a coloured moving mesh, against the truth of a synthetic body.
# A real recording is used where NEUPIG_TEST_DATA names a folder that holds kinect-rig/ (OpenCV files per frame).

load ../support/store

small=(--faces 2000 --method '{"poisson-depth": 6, "align-nodes": 80, "align-steps": 6}' --quiet
    --bars residual=100,coverage=0,flipped=100,stretched=100)

setup_file() {
    cd "$BATS_FILE_TMPDIR"
    "$NEUPIG" synth --rig --cameras 4 --frames 4 --cycles 0.1 --width 240 --height 180 --cell 0.04 --depth-noise 2 \
        -o capture >synth.log
    "$NEUPIG" run capture/rig/rig.json -o out --export ply,glb,usda,npz,obj "${small[@]}"
}

setup() {
    cd "$BATS_FILE_TMPDIR"
}

has_colours() {
    head -c 400 "$1" | grep -aq "property uchar red"
}

# The value of a key of a stage's report.
report() {
    python3 -c 'import json, sys; print(eval("json.load(open(sys.argv[1]))" + sys.argv[2]))' "$1/report.json" "$2"
}

# CD of a run's meshes from the truth.
chamfer() { # OUT TRUTH OPTIONS...
    "$NEUPIG" eval "$@" --json | python3 -c 'import json, sys; print(json.load(sys.stdin)["CD"])'
}

numpy() {
    /usr/bin/python3 -c 'import numpy' 2>/dev/null || skip "needs python3-numpy"
}

@test "the images of four sensors become a mesh close to the truth" {
    [ "$(report out '["stages"]["ingest"]["rig"]["sensors"].__len__()')" = 4 ]
    cd_mean=$(chamfer out capture/truth)
    echo "CD $cd_mean"
    awk -v cd="$cd_mean" 'BEGIN { exit !(cd < 4) }'
}

@test "every vertex has the colour that the body has there" {
    numpy
    run /usr/bin/python3 "$BATS_TEST_DIRNAME/colour_error.py" out capture/truth
    echo "$output"
    [ "$status" -eq 0 ]
    # a mesh of 1000 vertices over a texture that turns every 40 cm; the large rig of the guide has less
    awk -v e="${output##* }" 'BEGIN { exit !(e < 9) }'
}

@test "colours are in every format" {
    numpy
    has_colours out/reference.ply
    for mesh in out/meshes/*.ply; do has_colours "$mesh"; done
    grep -q displayColor out/motion.usda
    grep -aq COLOR_0 out/motion.glb
    awk '$1 == "v" { exit NF != 7 }' out/obj/frame_0000.obj
    /usr/bin/python3 -c '
import numpy
m = numpy.load("out/motion.npz")
assert m["colours"].shape == (m["reference"].shape[0], 4) and m["colours"][:, :3].std() > 20, m["colours"]
assert (m["colours"][:, 3] >= 254).all() and "frame_colours" not in m'
    "$NEUPIG" render out/reference.ply --colour vertex --height 64 -o coloured.png
    "$NEUPIG" render out/reference.ply --height 64 -o plain.png
    ! cmp -s coloured.png plain.png
}

@test "each frame's own colours, or none" {
    numpy
    "$NEUPIG" run capture/rig -o own --frames 0:2 --colour frames --export ply,npz,obj,usda "${small[@]}"
    "$NEUPIG" run capture/rig -o none --frames 0:2 --colour no --export npz "${small[@]}"
    /usr/bin/python3 -c '
import numpy
m, n = numpy.load("own/motion.npz"), numpy.load("none/motion.npz")
c = m["frame_colours"]
assert c.shape == m["vertices"].shape[:2] + (4,) and (c[0] != c[1]).any()
assert (c[..., 3] == 255).mean() > 0.5
assert "colours" not in n'
    # USD has them as samples, in linear light
    PYTHONPATH="$BATS_TEST_DIRNAME/../support" python3 - own <<'P'
import re, sys
from plain_files import read_vertices
text = open(sys.argv[1] + "/motion.usda").read()
samples = text.split("primvars:displayColor.timeSamples = {")[1].split("}")[0]
for frame in (0, 1):
    vertex = read_vertices(f"{sys.argv[1]}/meshes/frame_000{frame}.ply")[0]
    shares = [vertex[name] / 255 for name in ("red", "green", "blue")]
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in shares]
    first = re.search(rf"\n +{frame}: \[\(([^)]*)\)", samples).group(1).split(",")
    assert all(abs(float(a) - b) < 1e-5 for a, b in zip(first, linear)), (frame, first, linear)
P
    if has_colours none/reference.ply; then false; fi
    ! cmp -s <(grep '^v ' own/obj/frame_0000.obj | cut -d' ' -f5-) <(grep '^v ' own/obj/frame_0001.obj | cut -d' ' -f5-)
}

@test "a run that is killed and resumed gives the same coloured bytes" {
    options=(capture/rig --colour frames --method '{"window": 2, "overlap": 1, "reference-from": "all"}' "${small[@]}")
    "$NEUPIG" run "${options[@]}" -o whole
    rm -rf killed
    killed_at state:0 "$NEUPIG" run "${options[@]}" -o killed
    "$NEUPIG" run "${options[@]}" -o killed
    cmp whole/reference.ply killed/reference.ply
    diff -r whole/meshes killed/meshes
}

@test "a changed calibration is not the same job" {
    cp -r capture/rig changed
    "$NEUPIG" run changed -o job --frames 0:2 "${small[@]}"
    sed -i '0,/"fx": [0-9.]*/s//"fx": 230.0/' changed/rig.json
    run "$NEUPIG" run changed -o job --frames 0:2 "${small[@]}"
    echo "$output"
    [ "$status" -eq 2 ]
    [[ "$output" == *"is not the one it was"* ]]
}

@test "colours come with clouds, too, and parts of a capture keep theirs" {
    mkdir -p clouds
    for n in 0 1 2; do cp "capture/truth/frame_000$n.ply" clouds; done
    "$NEUPIG" run clouds -o of_clouds "${small[@]}"
    has_colours of_clouds/reference.ply
    has_colours of_clouds/meshes/frame_0001.ply
}

@test "probe says what each sensor sees, and that one is off" {
    run "$NEUPIG" probe capture/rig/rig.json
    echo "$output"
    [ "$status" -eq 0 ]
    [ "$(grep -c '^sensor ' <<<"$output")" -eq 4 ]
    cp capture/rig/rig.json capture/rig/off.json
    python3 - capture/rig/off.json <<'P'
import json, sys
rig = json.load(open(sys.argv[1]))
rig["sensors"][2]["pose"][3] += 0.02
rig["sensors"][2]["pose"][7] += 0.02
json.dump(rig, open(sys.argv[1], "w"))
P
    run "$NEUPIG" probe capture/rig/off.json
    echo "$output"
    [ "$status" -eq 7 ]
    [[ "$output" == *"attention sensor camera2 sees surfaces"* ]]
    "$NEUPIG" probe capture/rig --json | python3 -c '
import json, sys
sensors = json.load(sys.stdin)["sensors"]
assert len(sensors) == 4 and all(s["images"] == 4 and s["overlap"] > 0.02 and s["apart"] < 0.01 for s in sensors), sensors'
}

@test "a sensor that stands wrong is found, and the run corrects it" {
    numpy
    "$NEUPIG" synth --rig --cameras 4 --frames 2 --cycles 0.05 --width 640 --height 480 --cell 0.03 --depth-noise 2 \
        -o wide >synth.log
    run "$NEUPIG" probe wide/rig
    echo "$output"
    [ "$status" -eq 0 ]
    [ "$(grep -c '^pose .* aligned: ' <<<"$output")" -eq 3 ]
    # 12 mm, and 0.7 degrees about an axis of no coordinate
    /usr/bin/python3 - wide/rig <<'P'
import json, sys
import numpy as np
rig = json.load(open(sys.argv[1] + "/rig.json"))
pose = np.array(rig["sensors"][2]["pose"]).reshape(4, 4)
w = np.radians(0.7) * np.array([2, 6, -3]) / 7
cross = np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])
turn = np.eye(3) + np.sin(np.radians(0.7)) / np.radians(0.7) * cross + 0.5 * cross @ cross
pose[:3, :3] = np.linalg.svd(turn)[0] @ np.linalg.svd(turn)[2] @ pose[:3, :3]
pose[:3, 3] += 0.012 * np.array([6, -2, -3]) / 7
rig["sensors"][2]["pose"] = pose.ravel().tolist()
json.dump(rig, open(sys.argv[1] + "/off.json", "w"))
P
    run "$NEUPIG" probe wide/rig/off.json
    echo "$output"
    [ "$status" -eq 7 ]
    [ "$(grep -c '^attention' <<<"$output")" -eq 1 ]
    [[ "$output" == *"attention sensor camera2: its pose is off by 1"*"--align-sensors corrects it"* ]]
    run "$NEUPIG" probe wide/rig/off.json --align-sensors
    echo "$output"
    [ "$status" -eq 0 ]
    [[ "$output" == *", corrected; then"* ]]
    "$NEUPIG" probe wide/rig/off.json --align-sensors --json | python3 -c '
import json, sys
before = [s["before"] for s in json.load(sys.stdin)["sensors"]]
assert [s["pose"] == "off" for s in before] == [False, False, True, False], before
assert abs(before[2]["shift"] - 0.012) < 0.002 and abs(before[2]["turn_deg"] - 0.7) < 0.2, before
assert len(before[2]["correction"]) == 16'
    fine=(--frames 0:2 "${small[@]}" --faces 8000 --method '{"poisson-depth": 8,
        "align-nodes": 150}')
    for poses in rig.json off.json; do
        "$NEUPIG" run wide/rig/$poses --align-sensors -o "wide_$poses" "${fine[@]}"
    done
    "$NEUPIG" run wide/rig/off.json -o wide_wrong "${fine[@]}"
    [ "$(report wide_off.json '["stages"]["ingest"]["rig"]["sensors"][2]["pose"]')" = off ]
    for out in wide_rig.json wide_off.json wide_wrong; do
        chamfer $out wide/truth --frames 0:2
    done | tee cds
    awk '{ cd[NR] = $1 } END { exit !(cd[2] < 1.15 * cd[1] && cd[3] > 1.5 * cd[2]) }' cds
}

@test "bad rigs end with exit code 3, the file and the place" {
    cp -r capture/rig bad
    sed -i '0,/"fx"/s//"focal"/' bad/rig.json
    run "$NEUPIG" run bad -o out_bad "${small[@]}"
    echo "$output"
    [ "$status" -eq 3 ]
    [[ "$output" == *"bad/rig.json: sensors[0].camera.focal: unknown key"* ]]
    cp capture/rig/rig.json bad/rig.json
    head -c 2000 capture/rig/camera1/depth_0003.png >bad/camera1/depth_0003.png
    run "$NEUPIG" run bad -o out_bad "${small[@]}"
    echo "$output"
    [ "$status" -eq 3 ]
    [[ "$output" == *"camera1/depth_0003.png: byte"* ]]
    cp capture/rig/camera1/colour_0003.png bad/camera1/depth_0003.png
    run "$NEUPIG" run bad -o out_bad "${small[@]}"
    [ "$status" -eq 3 ]
    [[ "$output" == *"depth_0003.png: a 8-bit RGB PNG; a depth image must be 16-bit grey"* ]]
    cp capture/rig/camera1/depth_0003.png bad/camera1/depth_0003.png
    PYTHONPATH="$BATS_TEST_DIRNAME/../support" python3 -c '
from plain_files import write_depth
write_depth("bad/camera2/depth_0002.png", 180 * [240 * [65535]])'
    run "$NEUPIG" probe bad
    [ "$status" -eq 7 ]
    [[ "$output" == *"1 depth images have no depth in any pixel, the first is bad/camera2/depth_0002.png"* ]]
    run "$NEUPIG" run bad -o out_blank "${small[@]}" --no-quiet
    [ "$status" -eq 0 ]
    [[ "$output" == *"warning: 1 depth images have no depth in any pixel, the first is bad/camera2/depth_0002.png"* ]]
    run "$NEUPIG" run --rig bad -o out_bad
    [ "$status" -eq 2 ]
    [[ "$output" == *"the rig is the input"* ]]
}

@test "a confined rig may not lead out of its folder" {
    cp -r capture/rig led
    cp led/camera0/depth_0002.png outside.png
    ln -sf ../../outside.png led/camera0/depth_0002.png
    run "$NEUPIG" run led --confine -o out_led "${small[@]}"
    echo "$output"
    [ "$status" -eq 3 ]
    [[ "$output" == *"depth_0002.png"* ]]
}

@test "a rig.json is written for layouts of other programs" {
    python3 "$BATS_TEST_DIRNAME/foreign_rigs.py" capture/rig foreign
    "$NEUPIG" probe capture/rig/rig.json --json >own.json
    for layout in tum redwood opencv; do
        run "$NEUPIG" run foreign/$layout -o none
        [ "$status" -eq 3 ]
        [[ "$output" == *"without a rig.json: rig_json.py writes one"* ]]
        "$BATS_TEST_DIRNAME/../../tools/rig_json.py" foreign/$layout --depth-scale 0.0005
        "$NEUPIG" probe foreign/$layout --json >$layout.json
    done
    python3 - <<'END'
import json
own, tum, redwood, opencv = (json.load(open(f"{name}.json")) for name in ("own", "tum", "redwood", "opencv"))
counts = {probe["sensors"][0]["points"] for probe in (own, tum, redwood, opencv)}
print(counts, redwood["box"], opencv["box"])
assert len(counts) == 1
assert all(abs(a - b) < 1e-6 for side in ("low", "high") for a, b in zip(redwood["box"][side], opencv["box"][side]))
END
    run "$BATS_TEST_DIRNAME/../../tools/rig_json.py" foreign/tum
    [ "$status" -eq 1 ]
    [[ "$output" == *"there is one already"* ]]
    run "$BATS_TEST_DIRNAME/../../tools/rig_json.py" capture/points
    [[ "$output" == *"no layout that is known"* ]]
}

@test "lists with times and files of poses are written into a rig.json" {
    mkdir lists
    cp -r capture/rig/camera* lists/
    python3 - <<'END'
import json
root = json.load(open("capture/rig/rig.json"))
a, b, c = root["sensors"][:3]
# b came 5 ms later and has no second image; c is numbered and moves
for sensor, late, left_out in (a, 0, None), (b, 0.005, 1):
    folder = sensor["depth"].split("/")[0]
    names = [sensor["depth"] % at for at in range(4)]
    lines = [f"{at / 30 + late} {name.split('/')[1]}\n" for at, name in enumerate(names) if at != left_out]
    open(f"lists/{folder}/depth.txt", "w").write("# time path\n" + "".join(lines))
    sensor["depth"] = f"{folder}/depth.txt"
    del sensor["colour"]
c.pop("pose")
open("lists/c.txt", "w").write("".join(f"{at} 0 0 {at} 0 0.6 0 0.8\n" for at in range(4)))
c["poses"] = "c.txt"
root["sensors"] = [a, b]
json.dump(root, open("lists/rig.json", "w"))
root["sensors"] = [c]
json.dump(root, open("lists/moving.json", "w"))
END
    run "$NEUPIG" probe lists/rig.json
    [ "$status" -eq 3 ]
    [[ "$output" == *"sensors[0].depth: must be a pattern"*"rig_json.py"* ]]
    "$BATS_TEST_DIRNAME/../../tools/rig_json.py" lists/rig.json
    "$NEUPIG" probe lists/rig.json --json >lists.json
    "$BATS_TEST_DIRNAME/../../tools/rig_json.py" lists/moving.json
    python3 - <<'END'
import json
assert [sensor["images"] for sensor in json.load(open("lists.json"))["sensors"]] == [4, 3]
pose = json.load(open("lists/moving.json"))["sensors"][0]["poses"][3]
assert max(abs(a - b) for a, b in zip(pose, [.28, 0, .96, 0, 0, 1, 0, 0, -.96, 0, .28, 3, 0, 0, 0, 1])) < 1e-9
END
}

@test "a real recording: OpenCV files per frame" {
    data=${NEUPIG_TEST_DATA:-}/kinect-rig
    [ -d "$data" ] || skip "NEUPIG_TEST_DATA names no folder with kinect-rig"
    cp -r "$data" recording
    "$BATS_TEST_DIRNAME/../../tools/rig_json.py" recording
    run "$NEUPIG" run recording --sensor-poses none --frames 0:4 -o kinect --faces 2000 --quiet
    echo "$output"
    [ "$status" -eq 0 ] || [ "$status" -eq 7 ]
    has_colours kinect/reference.ply
}
