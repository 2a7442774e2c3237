// The other half of tools/view/view.h: blocks of bytes back to meshes and points.

const POINT_STEP = 16; // NPG_VIEW_POINT_STEP
export const ERROR_MAX = 0.05; // NPG_VIEW_ERROR_MAX, in diagonals

export function bytesOfBase64(text) {
    if (Uint8Array.fromBase64) return Uint8Array.fromBase64(text);
    const binary = atob(text);
    const bytes = new Uint8Array(binary.length);
    for (let i = 0; i < binary.length; i++) bytes[i] = binary.charCodeAt(i);
    return bytes;
}

async function inflate(bytes) {
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
    return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** Packed numbers: zigzag in four planes of bytes. */
async function unpack(bytes, count) {
    const out = new Int32Array(count);
    if (!count) return out;
    const planes = await inflate(bytes);
    if (planes.length !== 4 * count) throw new Error("a block of the page is damaged");
    for (let i = 0; i < count; i++) {
        const z =
            planes[i] |
            (planes[count + i] << 8) |
            (planes[2 * count + i] << 16) |
            (planes[3 * count + i] << 24);
        out[i] = (z >>> 1) ^ -(z & 1);
    }
    return out;
}

/** Of each vertex the lower ones that share a face with it, each as often as faces have it. */
export function linksOf(faces, vertices) {
    const start = new Uint32Array(vertices + 1);
    const each = (visit) => {
        for (let i = 0; i < faces.length; i++) {
            const first = i - (i % 3);
            for (let k = first; k < first + 3; k++) if (faces[k] < faces[i]) visit(faces[i], faces[k]);
        }
    };
    each((v) => start[v + 1]++);
    for (let v = 0; v < vertices; v++) start[v + 1] += start[v];
    const place = start.slice();
    const of = new Uint32Array(start[vertices]);
    each((v, lower) => (of[place[v]++] = lower));
    return { start, of };
}

/** Undo the prediction of one row of V numbers, from `left` at `at`, into out. */
function restoreRow(out, left, at, links) {
    const { start, of } = links;
    for (let i = 0, k = 0; i < out.length; i++) {
        const end = start[i + 1];
        const count = end - k;
        let sum = 0;
        for (; k < end; k++) sum += out[of[k]];
        const guess = count ? Math.floor((2 * sum + count) / (2 * count)) : i ? out[i - 1] : 0;
        out[i] = left[at + i] + guess;
    }
}

/** Reads little-endian numbers one after the other. */
class Reader {
    constructor(bytes) {
        this.bytes = bytes;
        this.view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
        this.at = 0;
    }
    u32() {
        this.at += 4;
        return this.view.getUint32(this.at - 4, true);
    }
    f64() {
        this.at += 8;
        return this.view.getFloat64(this.at - 8, true);
    }
    grid() {
        return { origin: [this.f64(), this.f64(), this.f64()], step: this.f64() };
    }
    take(size) {
        this.at += size;
        return this.bytes.subarray(this.at - size, this.at);
    }
}

/** What is the same in all frames of a part.  offset: of its coordinates in the scene. */
export async function readPart(bytes, offset) {
    const reader = new Reader(bytes);
    const vertices = reader.u32();
    const corners = 3 * reader.u32();
    const grid = reader.grid();
    const sizes = [reader.u32(), reader.u32(), reader.u32(), reader.u32()];
    const changes = await unpack(reader.take(sizes[0]), corners);
    const faces = new Uint32Array(corners);
    for (let i = 0, corner = 0; i < corners; i++) faces[i] = corner += changes[i];
    const links = linksOf(faces, vertices);
    const part = {
        vertices,
        faces,
        links,
        offset,
        rest: new Float32Array(3 * vertices),
        colours: null,
        seen: null,
    };
    const row = new Int32Array(vertices);
    const left = await unpack(reader.take(sizes[1]), 3 * vertices);
    for (let a = 0; a < 3; a++) {
        restoreRow(row, left, a * vertices, links);
        for (let i = 0; i < vertices; i++)
            part.rest[3 * i + a] = grid.origin[a] + offset[a] + grid.step * row[i];
    }
    if (sizes[2]) {
        const packed = await unpack(reader.take(sizes[2]), 3 * vertices);
        part.colours = new Uint8Array(3 * vertices);
        for (let a = 0; a < 3; a++) {
            restoreRow(row, packed, a * vertices, links);
            for (let i = 0; i < vertices; i++) part.colours[3 * i + a] = row[i];
        }
    }
    if (sizes[3]) {
        part.seen = new Int32Array(vertices);
        restoreRow(part.seen, await unpack(reader.take(sizes[3]), vertices), 0, links);
    }
    return part;
}

/** One frame's points, from `values` at `at`: three rows of changes. */
function placePoints(values, at, count, grid, offset) {
    const points = new Float32Array(3 * count);
    for (let a = 0; a < 3; a++)
        for (let i = 0, value = 0; i < count; i++) {
            value += values[at + a * count + i];
            points[3 * i + a] = grid.origin[a] + offset[a] + POINT_STEP * grid.step * value;
        }
    return points;
}

/** The frames of a group: {positions (V x 3), errors (V), near (V), points, dropped (N x 3)} each.  pause() is awaited
 * after each. */
export async function readGroup(bytes, part, pause) {
    const reader = new Reader(bytes);
    const grid = reader.grid();
    const count = reader.u32();
    const sizes = [reader.u32(), reader.u32(), reader.u32()];
    const pointCounts = Array.from({ length: count }, () => reader.u32());
    const droppedCounts = Array.from({ length: count }, () => reader.u32());
    const v = part.vertices;
    const left = await unpack(reader.take(sizes[0]), 3 * v * count);
    const leftErrors = await unpack(reader.take(sizes[1]), v * count);
    const points = await unpack(reader.take(sizes[2]), 3 * pointCounts.reduce((a, b) => a + b, 0));
    const now = [new Int32Array(v), new Int32Array(v), new Int32Array(v)];
    const change = new Int32Array(v);
    const frames = [];
    for (let t = 0, at = 0; t < count; at += 3 * pointCounts[t++]) {
        const positions = new Float32Array(3 * v);
        for (let a = 0; a < 3; a++) {
            restoreRow(change, left, (3 * t + a) * v, part.links);
            const first = grid.origin[a] + part.offset[a];
            for (let i = 0; i < v; i++) positions[3 * i + a] = first + grid.step * (now[a][i] += change[i]);
        }
        restoreRow(change, leftErrors, t * v, part.links);
        const shown = placePoints(points, at, pointCounts[t], grid, part.offset);
        const kept = shown.length - 3 * droppedCounts[t];
        frames.push({
            positions,
            errors: Uint8Array.from(change, (x) => x >> 1),
            near: Uint8Array.from(change, (x) => x & 1),
            points: shown.subarray(0, kept),
            dropped: shown.subarray(kept),
        });
        await pause();
    }
    return frames;
}

/** Diagonals that points lie outside the surface at a vertex, inside below 0, as it is stored; NaN: not known. */
export const errorOf = (value) =>
    value ? Math.sign(value - 128) * ((value - 128) / 127) ** 2 * ERROR_MAX : NaN;
