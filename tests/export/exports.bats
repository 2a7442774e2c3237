# Other formats of a run's meshes, read by programs that are not ours.

small=(--method '{"epochs": 10, "poisson-depth": 4, "window": 5, "overlap": 2,
                  "align-nodes": 40, "align-steps": 6}' --faces 400
    --bars residual=100,coverage=0,flipped=100 --quiet)
forms=(--method '{"align": false, "width-1": 32, "width-2": 32, "grid-levels": 3, "vdb-voxel": 0.04}' --export obj,ply,pc2,mdd,glb,glb-meshopt,vat,usda,npz,vdb --unit cm --up z --fps 24)

setup_file() {
    cd "$BATS_FILE_TMPDIR"
    "$NEUPIG-bodies" --body bar --frames 9 --points 400 -o capture >synth.log
    # Whether so few points are fitted well, which differs between builds, is no matter here: 7 says they are not.
    "$NEUPIG" run capture/points -o whole "${small[@]}" "${forms[@]}" >whole.log || [ $? -eq 7 ]
}

setup() {
    cd "$BATS_FILE_TMPDIR"
}

# A Python with NumPy: Debian's own, or what is first in the path.
find_python() {
    for python in /usr/bin/python3 python3; do
        "$python" -c 'import numpy' 2>/dev/null && return 0
    done
    skip "no Python with NumPy here"
}

# Modules from npm, once per machine; $modules is where they are.
find_modules() {
    command -v node >/dev/null && command -v npm >/dev/null || skip "no node and npm here"
    modules=${XDG_CACHE_HOME:-$HOME/.cache}/neupig-tests/npm-1
    [ -e "$modules/complete" ] && return 0
    mkdir -p "$modules"
    (cd "$modules" && timeout 120 npm install --no-save --no-audit --no-fund --prefix "$modules" \
        gltf-validator@2.0.0-dev.3.10 three@0.187 >npm.log 2>&1) || skip "npm can't fetch the readers (no network?)"
    touch "$modules/complete"
}

@test "NumPy reads the arrays, and both point caches are the meshes" {
    find_python
    "$python" "$BATS_TEST_DIRNAME/check_exports.py" numpy whole
}

@test "the Khronos validator finds neither errors nor warnings in the GLB" {
    find_modules
    node "$BATS_TEST_DIRNAME/check_exports.mjs" "$modules" glb whole/motion.glb whole/motion_meshopt.glb whole/motion_vat.glb
}

@test "a USD parser finds every sample" {
    find_modules
    node "$BATS_TEST_DIRNAME/check_exports.mjs" "$modules" usda whole
}

@test "normals and velocities of USD are those of the meshes" {
    find_python
    "$python" "$BATS_TEST_DIRNAME/check_exports.py" usda whole
}

@test "meshoptimizer's decoder finds every frame in the compact GLB" {
    find_modules
    node "$BATS_TEST_DIRNAME/check_exports.mjs" "$modules" meshopt whole
    [ "$(stat -c %s whole/motion_meshopt.glb)" -lt "$(stat -c %s whole/motion.glb)" ]
}

@test "vertex animation textures move the mesh as the run does" {
    find_python
    "$python" "$BATS_TEST_DIRNAME/check_exports.py" vat whole
}

@test "VTK plays the GLB" {
    find_python
    "$python" -c 'import vtk' 2>/dev/null || skip "VTK is not installed"
    "$python" "$BATS_TEST_DIRNAME/check_exports.py" vtk whole
}

@test "Blender reads point caches, GLB and volumes" {
    command -v blender >/dev/null || skip "Blender is not installed"
    blender -b --python-exit-code 3 -P "$BATS_TEST_DIRNAME/check_exports.py" -- blender "$PWD/whole"
}

@test "done.json lists every file that lies there" {
    find . -path './whole/*' -type f -not -path './whole/job/*' -not -name done.json | sed 's|./whole/||' | sort >there
    grep -o '"path":"[^"]*"' whole/done.json | cut -d'"' -f4 | sort >listed
    diff there listed
    grep -q '"up": "z"' whole/done.json
    grep -q '"metres_per_unit": 0.01' whole/done.json
}

@test "the latent grids of every window lie in the job folder" {
    [ "$(ls whole/job/window_*.vdb | wc -l)" -gt 1 ]
    if command -v vdb_print >/dev/null; then
        vdb_print whole/job/window_000000.vdb | grep position_L02
        vdb_print whole/volumes/frame_0000.vdb | grep surface
    fi
}

@test "OBJ files keep colours and texture coordinates of the user's mesh" {
    find_python
    "$NEUPIG" run capture/points -o plain "${small[@]}" --keyframe 4 --export obj
    "$python" - <<'END'
lines, corner = [], 0
for line in open("plain/meshes/frame_0004.obj"):
    words = line.split()
    if words[0] == "v":
        lines.append(line.strip() + " 0.25 0.5 0.75")
    if words[0] == "f":  # every corner has a texture coordinate of its own
        lines += [f"vt {0.001 * (corner + k):.4f} {0.5 + 0.001 * k:.4f}" for k in range(3)]
        lines.append("f " + " ".join(f"{words[1 + k]}/{corner + k + 1}" for k in range(3)))
        corner += 3
open("mine.obj", "w").write("# mine\nmtllib mine.mtl\nusemtl skin\n" + "\n".join(lines) + "\n")
END
    "$NEUPIG" run capture/points -o own "${small[@]}" --keyframe 4 --reference mine.obj --export ply,obj,glb,npz
    "$python" "$BATS_TEST_DIRNAME/check_exports.py" obj own mine.obj
    grep -aq "property float s" own/meshes/frame_0000.ply
    grep -aq "property uchar red" own/meshes/frame_0000.ply
    "$python" -c "import numpy as np; z = np.load('own/motion.npz'); assert z['corner_uvs'].shape == (len(z['faces']), 3, 2); assert (z['colours'][:, :3] == [64, 128, 191]).all()"
    find_modules
    node "$BATS_TEST_DIRNAME/check_exports.mjs" "$modules" glb own/motion.glb
}

@test "a run killed while it writes formats goes on and gives the same bytes" {
    "$NEUPIG" run capture/points -o killed "${small[@]}" "${forms[@]}" >killed.log 2>&1 &
    pid=$!
    while kill -0 $pid 2>/dev/null && [ ! -d killed/volumes ]; do sleep 0.005; done
    kill -KILL $pid 2>/dev/null || true
    wait $pid || true
    [ ! -e killed/done.json ]
    "$NEUPIG" run capture/points -o killed "${small[@]}" "${forms[@]}" || [ $? -eq 7 ]
    grep -q resumed_frames killed/report.json
    for name in motion.pc2 motion.mdd motion.glb motion_meshopt.glb motion_vat.glb motion_vat_positions.png motion.usda motion.npz reference.obj obj volumes; do
        diff -r whole/$name killed/$name
    done
    [ -z "$(find killed -name '.*.part')" ]
}

@test "what is no format, and what a format can't hold, is said before the fit" {
    run "$NEUPIG" run capture/points -o no "${small[@]}" --export glb,fbx
    [ "$status" -eq 2 ]
    [[ "$output" == *'"fbx" is none of'* ]]
    run "$NEUPIG" run capture/points -o no "${small[@]}" --export glb,
    [ "$status" -eq 2 ]
    mkdir -p far
    for i in 0 1 2 3; do
        awk -v i=$i 'BEGIN { for (k = 0; k < 60; k++)
            printf "%.4f %.4f %.4f\n", 500000 + cos(k) * 2, 4000000 + sin(k) * 2, (k % 7) / 3 + i / 10 }' \
            >far/f_$i.xyz
    done
    run "$NEUPIG" run far -o no "${small[@]}" --method '{"poisson-depth": 5}' --export npz
    echo "$output"
    [ "$status" -eq 2 ]
    [[ "$output" == *"npz can't hold the capture"*"set centre"* ]]
    [ ! -e no/meshes ]
    run "$NEUPIG" run capture/points -o whole "${small[@]}" --restart --reference whole/reference.ply
    [ "$status" -eq 2 ]
    [[ "$output" == *"lies where this run writes"* ]]
    [ -e whole/done.json ]
}
