// Whether a page holds what its run left: every position within half a step of 16 bits of the frame's box, faces and
// errors as they are, the figures of frames.jsonl bit by bit.
//
//     node check_page.mjs PAGE RUN [FRAME-STEP [KEPT]]
//
// KEPT: so many points of the first frame belong to the surface, the last ones were dropped.
import fs from "node:fs";
import path from "node:path";
import { framesOf, longestOf, readPage, readPly, readPoints } from "./page_file.mjs";

const [pagePath, run, step = "1", kept = "Infinity"] = process.argv.slice(2);

function expect(condition, text) {
    if (condition) return;
    console.log(text);
    process.exit(1);
}

const at = (values, i) => [values[3 * i], values[3 * i + 1], values[3 * i + 2]];
const minus = (a, b) => a.map((x, k) => x - b[k]);
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];

/** Weights of the point of a triangle that is closest to p, by its edges and its inside. */
function closestOf(p, corners) {
    const [a, b, c] = corners;
    const n = cross(minus(b, a), minus(c, a));
    const area = (x, y) => dot(cross(minus(x, p), minus(y, p)), n) / (dot(n, n) || 1);
    const inside = [area(b, c), area(c, a), area(a, b)];
    const tries = inside.every((w) => w >= 0) ? [inside] : [];
    for (let k = 0; k < 3; k++) {
        const [from, to] = [corners[k], corners[(k + 1) % 3]];
        const way = minus(to, from);
        const t = Math.min(Math.max(dot(minus(p, from), way) / (dot(way, way) || 1), 0), 1);
        const weights = [0, 0, 0];
        weights[k] = 1 - t;
        weights[(k + 1) % 3] = t;
        tries.push(weights);
    }
    const ends = tries.map((weights) => {
        const foot = [0, 1, 2].map((x) => corners.reduce((sum, q, k) => sum + weights[k] * q[x], 0));
        return { weights, foot, distance: Math.hypot(...minus(p, foot)) };
    });
    return ends.reduce((best, end) => (end.distance < best.distance ? end : best));
}

/** A ball around a triangle: a face whose ball is farther than the closest so far is not closer. */
function ballOf(corners) {
    const middle = [0, 1, 2].map((x) => corners.reduce((sum, q) => sum + q[x], 0) / 3);
    return { middle, radius: Math.max(...corners.map((q) => Math.hypot(...minus(q, middle)))) };
}

/** What the page should hold of each vertex, by trying all faces for each point: signed distances spread over corners
 * and their neighbours; NaN where no point fell near. */
function errorsOf(mesh, points) {
    const { positions, faces } = mesh;
    const count = positions.length / 3;
    const corners = Array.from({ length: faces.length / 3 }, (_, f) =>
        [0, 1, 2].map((k) => at(positions, faces[3 * f + k])),
    );
    const balls = corners.map(ballOf);
    const normals = Array.from({ length: count }, () => [0, 0, 0]);
    corners.forEach(([a, b, c], f) => {
        const n = cross(minus(b, a), minus(c, a));
        for (let k = 0; k < 3; k++)
            normals[faces[3 * f + k]] = normals[faces[3 * f + k]].map((x, i) => x + n[i]);
    });
    const first = Array.from({ length: count }, () => [0, 0]);
    for (let i = 0; i < points.length / 3; i++) {
        const p = at(points, i);
        let best = { distance: Infinity };
        corners.forEach((triangle, f) => {
            const { middle, radius } = balls[f];
            if (Math.hypot(...minus(middle, p)) - radius > best.distance) return;
            const end = closestOf(p, triangle);
            if (end.distance < best.distance) best = { ...end, f };
        });
        const own = [0, 1, 2].map((k) => faces[3 * best.f + k]);
        const side = own.reduce((sum, v, k) => {
            const n = normals[v].map((x) => x / (Math.hypot(...normals[v]) || 1));
            return sum + best.weights[k] * dot(minus(p, best.foot), n);
        }, 0);
        own.forEach((v, k) => {
            first[v][0] += best.weights[k] * best.distance * Math.sign(side);
            first[v][1] += best.weights[k];
        });
    }
    const spread = Array.from({ length: count }, () => [0, 0]);
    faces.forEach((v, i) => {
        for (let k = i - (i % 3); k < i - (i % 3) + 3; k++)
            for (let s = 0; s < 2; s++) spread[v][s] += first[faces[k]][s];
    });
    return spread.map(([sum, weight]) => (weight > 1e-4 ? sum / weight : NaN));
}

function nearest(points, p) {
    let best = Infinity;
    for (let i = 0; i < points.length / 3; i++) best = Math.min(best, Math.hypot(...minus(at(points, i), p)));
    return best;
}

function checkErrors(frame, line, facts, mesh, points) {
    const code = (error) => {
        const share = error / (0.05 * facts.diagonal);
        return 128 + Math.sign(share) * 127 * Math.sqrt(Math.min(Math.abs(share), 1));
    };
    let off = 0;
    const wanted = errorsOf(mesh, points);
    wanted.forEach((error, v) => {
        if (Number.isNaN(error)) return;
        expect(frame.errors[v] > 0, `frame ${line.number}, vertex ${v}: no error, not ${error}`);
        // where two faces are as near, rounding may choose the other: sides differ, sizes don't
        off += Math.abs(code(error) - frame.errors[v]) > 1.5;
    });
    expect(off <= 0.01 * wanted.length, `frame ${line.number}: ${off} errors are others`);
    for (const v of [0, 7, 100, 501].filter((i) => i < facts.vertices)) {
        const isNear = nearest(points, at(mesh.positions, v)) <= facts.cover * facts.diagonal;
        expect(Boolean(frame.near[v]) === isNear, `frame ${line.number}, vertex ${v}: near`);
    }
}

function checkFrame(frame, line, facts, isFirst) {
    const mesh = readPly(path.join(run, line.file));
    const bound = (0.5 * longestOf(mesh.positions)) / 65535 + 1e-6 * longestOf(mesh.positions);
    let worst = 0;
    for (let i = 0; i < mesh.positions.length; i++)
        worst = Math.max(worst, Math.abs(mesh.positions[i] - frame.positions[i]));
    expect(worst <= bound, `frame ${line.number}: a position is off by ${worst}, the bound is ${bound}`);
    if (isFirst) checkErrors(frame, line, facts, mesh, readPoints(line.source).slice(0, 3 * Number(kept)));
    return worst / bound;
}

const page = readPage(pagePath);
const lines = fs
    .readFileSync(path.join(run, "frames.jsonl"), "utf8")
    .trim()
    .split("\n")
    .map((line) => JSON.parse(line));
const chosen = lines.filter((line) => line.index % Number(step) === 0 || line.key);
const { facts, data, frames } = await framesOf(page, 0, 0);
expect(
    facts.frames.length === chosen.length && frames.length === chosen.length,
    `${frames.length} frames, not ${chosen.length}`,
);
expect(String(data.faces) === String(readPly(path.join(run, "reference.ply")).faces), "the faces differ");
let worst = 0;
chosen.forEach((line, i) => {
    const told = facts.frames[i];
    expect(
        JSON.stringify(told.figures) === JSON.stringify(line.figures),
        `frame ${line.number}: other figures`,
    );
    expect(
        told.mesh === Boolean(line.file) && told.good === line.good,
        `frame ${line.number}: another verdict`,
    );
    if (line.file) worst = Math.max(worst, checkFrame(frames[i], line, facts, i === 0));
});
const shown = frames.map((frame) => frame.points.length / 3);
const dropped = frames.reduce((sum, frame) => sum + frame.dropped.length / 3, 0);
const seen = data.seen ? Math.max(...data.seen) : "none";
console.log(
    `${frames.length} frames, ${facts.vertices} vertices, off by ${worst.toFixed(3)} of the bound, ${Math.max(...shown)} points, seen in ${seen}, ${dropped} dropped`,
);
