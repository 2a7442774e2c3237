// Independent readers from npm, of what `neupig run --export` writes.
//
//     node check_exports.mjs MODULES glb FILE ...     Khronos glTF validator: no errors, no warnings
//     node check_exports.mjs MODULES meshopt RUN      three's meshopt decoder: every frame of motion_meshopt.glb is the PLY mesh
//     node check_exports.mjs MODULES usda RUN         three's USD parser: every sample equals the PLY meshes
import fs from "fs";
import { createRequire } from "module";

const [modules, what, ...files] = process.argv.slice(2);
const need = createRequire(`${modules}/node_modules/`);

function fail(text) {
    console.log(text);
    process.exit(1);
}

async function checkGlb(file) {
    const report = await need("gltf-validator").validateBytes(new Uint8Array(fs.readFileSync(file)));
    const { numErrors, numWarnings, messages } = report.issues;
    console.log(`${file}: ${numErrors} errors, ${numWarnings} warnings, ${report.info.totalVertexCount} vertices`);
    if (numErrors || numWarnings) fail(JSON.stringify(messages.slice(0, 5)));
}

// Positions of a binary little-endian PLY whose vertices begin with x, y and z as floats.
function positionsOf(path) {
    const bytes = fs.readFileSync(path), end = bytes.indexOf("end_header\n") + 11;
    const head = bytes.subarray(0, end).toString(), count = Number(/element vertex (\d+)/.exec(head)[1]);
    const vertex = head.slice(head.indexOf("element vertex"), head.indexOf("element face"));
    const sizes = [...vertex.matchAll(/property (\w+)/g)].map((m) => ({ float: 4, uchar: 1 })[m[1]]);
    const stride = sizes.reduce((a, b) => a + b), all = [];
    for (let i = 0; i < count; i++)
        for (let a = 0; a < 3; a++) all.push(bytes.readFloatLE(end + i * stride + 4 * a));
    return all;
}

const numbersOf = (text) => [...String(text).matchAll(/-?\d[\d.e+-]*/g)].map((m) => Math.fround(Number(m[0])));

async function checkUsda(run) {
    const { USDAParser } = await import(`${modules}/node_modules/three/examples/jsm/loaders/usd/USDAParser.js`);
    const stage = new USDAParser().parseText(fs.readFileSync(`${run}/motion.usda`, "utf8"));
    const done = JSON.parse(fs.readFileSync(`${run}/done.json`, "utf8"));
    const head = fs.readFileSync(`${run}/motion.usda`, "utf8").slice(0, 400);
    const mesh = stage['def Xform "capture"']['def Mesh "surface"'];
    const samples = mesh["point3f[] points.timeSamples"], extents = mesh["float3[] extent.timeSamples"];
    const frames = fs.readFileSync(`${run}/frames.jsonl`, "utf8").trim().split("\n").map((line) => JSON.parse(line));
    for (const [key, value] of [["metersPerUnit", done.metres_per_unit], ["timeCodesPerSecond", done.fps],
        ["upAxis", `"${done.up.toUpperCase()}"`], ["endTimeCode", frames.at(-1).index]])
        if (!head.includes(`${key} = ${value}\n`)) fail(`usda: no ${key} = ${value}`);
    if (numbersOf(mesh["int[] faceVertexIndices"]).length !== 3 * numbersOf(mesh["int[] faceVertexCounts"]).length)
        fail("usda: indices and counts of the faces do not go together");
    let compared = 0;
    for (const frame of frames.filter((one) => one.file)) {
        const is = numbersOf(samples[frame.index]), expected = positionsOf(`${run}/${frame.file}`);
        const box = numbersOf(extents[frame.index]);
        if (is.length !== expected.length || is.some((x, i) => x !== expected[i])) fail(`usda: frame ${frame.index}`);
        for (let a = 0; a < 3; a++) {
            const axis = expected.filter((_, i) => i % 3 === a);
            if (box[a] !== Math.min(...axis) || box[3 + a] !== Math.max(...axis)) fail(`usda: extent ${frame.index}`);
        }
        compared++;
    }
    for (const kind of ["normal3f[] normals", "vector3f[] velocities"])
        if (Object.keys(mesh[`${kind}.timeSamples`]).length !== compared) fail(`usda: not as many ${kind}`);
    if (Object.keys(samples).length !== compared || Object.keys(extents).length !== compared)
        fail(`usda: ${Object.keys(samples).length} samples for ${compared} frames`);
    console.log(`${run}/motion.usda: ${compared} samples are the meshes'`);
}

// Unpacked rows of an accessor of a compact GLB, as numbers.
function rowsOf(decoder, root, binary, at) {
    const accessor = root.accessors[at], packed = root.bufferViews[accessor.bufferView].extensions.EXT_meshopt_compression;
    const width = { SCALAR: 1, VEC2: 2, VEC3: 3, VEC4: 4 }[accessor.type], out = new Uint8Array(packed.count * packed.byteStride);
    const source = binary.subarray(packed.byteOffset, packed.byteOffset + packed.byteLength);
    decoder.decodeGltfBuffer(out, packed.count, packed.byteStride, source, packed.mode, packed.filter);
    const Kind = { 5122: Int16Array, 5123: Uint16Array, 5125: Uint32Array, 5126: Float32Array }[accessor.componentType];
    const all = new Kind(out.buffer), stride = packed.byteStride / Kind.BYTES_PER_ELEMENT, rows = [];
    for (let i = 0; i < accessor.count; i++) rows.push([...all.subarray(i * stride, i * stride + width)]);
    for (const [limit, pick] of [["min", Math.min], ["max", Math.max]])
        (accessor[limit] ?? []).forEach((value, a) => {
            if (value !== rows.reduce((x, row) => pick(x, row[a]), rows[0][a])) fail(`meshopt: ${limit} of accessor ${at}`);
        });
    return rows;
}

async function checkMeshopt(run) {
    const { MeshoptDecoder } = await import(`${modules}/node_modules/three/examples/jsm/libs/meshopt_decoder.module.js`);
    await MeshoptDecoder.ready;
    const bytes = fs.readFileSync(`${run}/motion_meshopt.glb`), length = bytes.readUInt32LE(12);
    const root = JSON.parse(bytes.subarray(20, 20 + length).toString()), binary = bytes.subarray(28 + length);
    const rows = (at) => rowsOf(MeshoptDecoder, root, binary, at), part = root.meshes[0].primitives[0];
    const grid = root.nodes[root.nodes[0].children[0]], step = grid.scale[0], base = rows(part.attributes.POSITION);
    const place = (row) => row.map((q, a) => grid.translation[a] + step * q);
    const frames = fs.readFileSync(`${run}/frames.jsonl`, "utf8").trim().split("\n").map((line) => JSON.parse(line))
        .filter((one) => one.file);
    const near = (p, q) => Math.max(...p.map((x, a) => Math.abs(x - q[a]))) <= 0.501 * step;
    const whole = frames.map((frame) => { const all = positionsOf(`${run}/${frame.file}`); return base.map((_, i) => all.slice(3 * i, 3 * i + 3)); });
    const moved = [base, ...part.targets.map((target) => {
        const deltas = rows(target.POSITION);
        return base.map((row, i) => row.map((q, a) => q + deltas[i][a]));
    })].map((pose) => pose.map(place));
    if (moved.length !== frames.length) fail(`meshopt: ${moved.length} poses of ${frames.length} frames`);
    // the vertex that each one is in all frames
    const same = base.map((_, i) => base.findIndex((_, j) => whole.every((pose, t) => near(pose[j], moved[t][i]))));
    if (same.includes(-1)) fail(`meshopt: vertex ${same.indexOf(-1)} is none of the meshes'`);
    if (new Set(same).size !== base.length) fail("meshopt: two vertices are the same one");
    const round = (face) => face.map((_, k) => [0, 1, 2].map((j) => face[(k + j) % 3]).join()).sort()[0];
    const faces = (list) => { const all = []; for (let i = 0; i < list.length; i += 3) all.push(round(list.slice(i, i + 3))); return all.sort(); };
    const obj = fs.readFileSync(`${run}/reference.obj`, "utf8").split("\n").filter((line) => line.startsWith("f "))
        .flatMap((line) => line.split(/\s+/).slice(1, 4).map((word) => parseInt(word) - 1));
    if (faces(rows(part.indices).map(([i]) => same[i])).join(" ") !== faces(obj).join(" ")) fail("meshopt: other faces");
    const motion = root.animations[0].samplers[0], weights = rows(motion.output), t = frames.length;
    if (weights.some(([w], i) => w !== +(i >= t - 1 && (i - (t - 1)) % t === 0))) fail("meshopt: weights");
    console.log(`${run}/motion_meshopt.glb: ${t} frames within half a step of ${step}, ${bytes.length} bytes`);
}

for (const file of files) await { glb: checkGlb, usda: checkUsda, meshopt: checkMeshopt }[what](file);
