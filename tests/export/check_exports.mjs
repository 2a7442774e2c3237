// Independent readers from npm, of what `neupig run --export` writes.
//
//     node check_exports.mjs MODULES glb FILE ...     Khronos glTF validator: no errors, no warnings
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
    if (Object.keys(samples).length !== compared || Object.keys(extents).length !== compared)
        fail(`usda: ${Object.keys(samples).length} samples for ${compared} frames`);
    console.log(`${run}/motion.usda: ${compared} samples are the meshes'`);
}

for (const file of files) await { glb: checkGlb, usda: checkUsda }[what](file);
