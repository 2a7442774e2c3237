// What tests know of a page without opening it: its blocks, decoded by the page's own codec, and the meshes of a run.
import fs from "node:fs";
import { readGroup, readPart } from "../../../tools/view/web/src/codec.js";

/** {facts, block(id)} of a page. */
export function readPage(path) {
    const text = fs.readFileSync(path, "utf8");
    const blocks = new Map();
    for (const match of text.matchAll(/<script type="([a-z/]+)" id="([a-z0-9-]+)"[^>]*>([^<]*)<\/script>/g))
        blocks.set(match[2], match[3]);
    return {
        facts: JSON.parse(blocks.get("facts")),
        block: (id) => new Uint8Array(Buffer.from(blocks.get(id), "base64")),
        ids: [...blocks.keys()],
    };
}

/** Positions (V x 3) and faces of a binary little-endian PLY whose vertices are floats. */
export function readPly(path) {
    const bytes = fs.readFileSync(path);
    const end = bytes.indexOf("end_header\n") + 11;
    const head = bytes.subarray(0, end).toString();
    const count = (what) => Number(new RegExp(`element ${what} (\\d+)`).exec(head)?.[1] ?? 0);
    const vertex = head.slice(head.indexOf("element vertex")).split("element face")[0];
    const sizes = [...vertex.matchAll(/property (\w+)/g)].map((m) => ({ float: 4, uchar: 1 })[m[1]]);
    const stride = sizes.reduce((a, b) => a + b);
    const positions = new Float64Array(3 * count("vertex"));
    for (let i = 0; i < positions.length; i++)
        positions[i] = bytes.readFloatLE(end + stride * Math.floor(i / 3) + 4 * (i % 3));
    const faces = [];
    for (let f = 0, at = end + stride * count("vertex"); f < count("face"); f++, at += 13)
        for (let k = 0; k < 3; k++) faces.push(bytes.readInt32LE(at + 1 + 4 * k));
    return { positions, faces };
}

/** Points of a capture's file: PLY, or a line "X Y Z" for each. */
export function readPoints(path) {
    if (path.endsWith(".ply")) return readPly(path).positions;
    return Float64Array.from(fs.readFileSync(path, "utf8").trim().split(/\s+/), Number);
}

/** All frames of a part in the coordinates of its meshes. */
export async function framesOf(page, result, part) {
    const facts = page.facts.results[result].parts[part];
    const data = await readPart(page.block(`data-${result}-${part}`), facts.origin);
    const frames = [];
    for (let g = 0; g * facts.group < facts.frames.length; g++)
        frames.push(...(await readGroup(page.block(`data-${result}-${part}-${g}`), data, async () => {})));
    return { facts, data, frames };
}

/** The longest side of a mesh's box. */
export function longestOf(positions) {
    const sides = [0, 1, 2].map((a) => {
        let low = Infinity,
            high = -Infinity;
        for (let i = a; i < positions.length; i += 3) {
            low = Math.min(low, positions[i]);
            high = Math.max(high, positions[i]);
        }
        return high - low;
    });
    return Math.max(...sides);
}
