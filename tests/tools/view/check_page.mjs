// Whether a page holds what its run left: every position within half a step of 16 bits of the frame's box, faces and
// errors as they are, the figures of frames.jsonl bit by bit.
//
//     node check_page.mjs PAGE RUN [FRAME-STEP]
import fs from "node:fs";
import path from "node:path";
import { framesOf, longestOf, readPage, readPly } from "./page_file.mjs";

const [pagePath, run, step = "1"] = process.argv.slice(2);

function expect(condition, text) {
    if (condition) return;
    console.log(text);
    process.exit(1);
}

/** Distance of each position to the nearest point, by trying all. */
function distances(positions, points, some) {
    return some.map((v) => {
        let best = Infinity;
        for (let i = 0; i < points.length; i += 3)
            best = Math.min(
                best,
                Math.hypot(
                    points[i] - positions[3 * v],
                    points[i + 1] - positions[3 * v + 1],
                    points[i + 2] - positions[3 * v + 2],
                ),
            );
        return best;
    });
}

function checkFrame(frame, line, facts) {
    const mesh = readPly(path.join(run, line.file));
    const bound = (0.5 * longestOf(mesh.positions)) / 65535 + 1e-6 * longestOf(mesh.positions);
    let worst = 0;
    for (let i = 0; i < mesh.positions.length; i++)
        worst = Math.max(worst, Math.abs(mesh.positions[i] - frame.positions[i]));
    expect(worst <= bound, `frame ${line.number}: a position is off by ${worst}, the bound is ${bound}`);
    const points = readPly(line.source).positions;
    const some = [0, 7, 100, 501].filter((v) => v < facts.vertices);
    distances(mesh.positions, points, some).forEach((distance, i) => {
        const value = Math.min(255, 255 * Math.sqrt(distance / (0.05 * facts.diagonal)));
        expect(
            Math.abs(value - frame.errors[some[i]]) < 0.6,
            `frame ${line.number}, vertex ${some[i]}: error ${frame.errors[some[i]]}, not ${value}`,
        );
    });
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
    if (line.file) worst = Math.max(worst, checkFrame(frames[i], line, facts));
});
const shown = frames.map((frame) => frame.points.length / 3);
const seen = data.seen ? Math.max(...data.seen) : "none";
console.log(
    `${frames.length} frames, ${facts.vertices} vertices, off by ${worst.toFixed(3)} of the bound, ${Math.max(...shown)} points, seen in ${seen}`,
);
