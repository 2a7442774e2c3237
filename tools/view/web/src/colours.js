// Colour modes: what a vertex is coloured by, from which numbers, and the legend that goes with it.
import { errorOf } from "./codec.js";

/** Stops of colour maps that keep their order in grey and for most who see colours differently (0xrrggbb). */
const MAPS = {
    heat: [0x14213d, 0x1f5f8b, 0x2a9d8f, 0xe9c46a, 0xf4772e, 0xd62839],
    diverging: [0x2166ac, 0x67a9cf, 0xf2f2f2, 0xef8a62, 0xb2182b],
    covered: [0xe07a3f, 0x3f8ec0],
    counts: [0x440154, 0x414487, 0x2a788e, 0x22a884, 0x7ad151, 0xfde725],
};

export const MODES = [
    { id: "plain", label: "Plain", shader: 0 },
    { id: "vertex", label: "Vertex colour", shader: 1 },
    { id: "identity", label: "Identity (checker)", shader: 2 },
    { id: "normal", label: "Normal", shader: 3 },
    { id: "error", label: "Error", shader: 4, map: "heat" },
    { id: "stretch", label: "Stretch", shader: 4, map: "diverging" },
    { id: "coverage", label: "Coverage", shader: 4, map: "covered" },
    { id: "seen", label: "Seen in frames", shader: 4, map: "counts" },
];

export const modeOf = (id) => MODES.find((mode) => mode.id === id);

/** Why a result has nothing to show in a mode; "" where it has. */
export function lackOf(id, capture) {
    const parts = capture.results.flatMap((result) => result.facts.parts);
    const stores = capture.results.flatMap((result) => result.stores);
    const noPoints = parts.find((part) => part.no_points)?.no_points;
    const withPoints = parts.some((part) => part.with_points);
    if (id === "vertex" && stores.every((store) => store.part && !store.part.colours))
        return "The meshes have no vertex colours.";
    if (["error", "coverage", "seen", "points"].includes(id) && !withPoints)
        return `The frames' points could not be read when the page was made${noPoints ? ` (${noPoints})` : ""}.`;
    return "";
}

function colourAt(stops, share) {
    const at = Math.min(Math.max(share, 0), 1) * (stops.length - 1);
    const low = Math.min(Math.floor(at), stops.length - 2);
    const channel = (colour, shift) => (colour >> shift) & 255;
    return [16, 8, 0].map((shift) => {
        const [a, b] = [channel(stops[low], shift), channel(stops[low + 1], shift)];
        return Math.round(a + (b - a) * (at - low));
    });
}

/** 256 x RGBA of a map, for a texture. */
export function mapBytes(name) {
    const bytes = new Uint8Array(1024);
    for (let i = 0; i < 256; i++) {
        const share = name === "covered" ? (i < 128 ? 0 : 1) : i / 255;
        bytes.set([...colourAt(MAPS[name], share), 255], 4 * i);
    }
    return bytes;
}

export function gradientOf(name) {
    const css = ([r, g, b]) => `rgb(${r} ${g} ${b})`;
    if (name === "covered") {
        const [off, on] = [css(colourAt(MAPS.covered, 0)), css(colourAt(MAPS.covered, 1))];
        return `linear-gradient(90deg, ${off} 50%, ${on} 50%)`;
    }
    const stops = [0, 0.2, 0.4, 0.6, 0.8, 1].map((share) => css(colourAt(MAPS[name], share)));
    return `linear-gradient(90deg, ${stops.join(", ")})`;
}

export const ERROR_RANGES = [0.1, 0.25, 0.5, 1, 2, 5];
export const STRETCH_RANGE = 0.5;

/** A range of errors that shows where a frame is worse than usual: of the 98th of 100 vertices. */
export function errorRangeFor(errors) {
    const sorted = Array.from(errors).sort((a, b) => a - b);
    const high = 100 * errorOf(sorted[Math.floor(0.98 * (sorted.length - 1))] ?? 0);
    return ERROR_RANGES.find((range) => range >= high) ?? ERROR_RANGES.at(-1);
}

/** Unique edges with their lengths at rest, and how many each vertex has. */
export function edgesOf(part) {
    const known = new Set();
    const ends = [];
    for (let i = 0; i < part.faces.length; i++) {
        const next = i % 3 === 2 ? i - 2 : i + 1;
        const [low, high] = [
            Math.min(part.faces[i], part.faces[next]),
            Math.max(part.faces[i], part.faces[next]),
        ];
        const key = high * part.vertices + low;
        if (low === high || known.has(key)) continue;
        known.add(key);
        ends.push(low, high);
    }
    const edges = { ends: Uint32Array.from(ends), count: new Uint16Array(part.vertices) };
    for (const v of edges.ends) edges.count[v]++;
    edges.rest = lengthsOf(edges.ends, part.rest);
    return edges;
}

function lengthsOf(ends, positions) {
    const lengths = new Float32Array(ends.length / 2);
    for (let e = 0; e < lengths.length; e++) {
        const [a, b] = [3 * ends[2 * e], 3 * ends[2 * e + 1]];
        const [x, y, z] = [0, 1, 2].map((k) => positions[a + k] - positions[b + k]);
        lengths[e] = Math.sqrt(x * x + y * y + z * z);
    }
    return lengths;
}

function stretchOf(out, frame, edges) {
    const { ends, rest, count } = edges;
    const p = frame.positions;
    out.fill(0);
    for (let e = 0; e < rest.length; e++) {
        const i = ends[2 * e],
            j = ends[2 * e + 1];
        const x = p[3 * i] - p[3 * j],
            y = p[3 * i + 1] - p[3 * j + 1],
            z = p[3 * i + 2] - p[3 * j + 2];
        const change = rest[e] > 0 ? Math.sqrt(x * x + y * y + z * z) / rest[e] - 1 : 0;
        out[i] += change;
        out[j] += change;
    }
    for (let i = 0; i < out.length; i++)
        out[i] = 0.5 + (count[i] ? out[i] / count[i] : 0) / (2 * STRETCH_RANGE);
}

/** Fill out (V, 0 to 1 along the mode's map) for a frame. */
export function fillShares(out, id, frame, store, range) {
    const { part, facts } = store;
    if (id === "stretch") {
        part.edges ??= edgesOf(part);
        stretchOf(out, frame, part.edges);
    } else if (id === "error") {
        for (let i = 0; i < out.length; i++) out[i] = (100 * errorOf(frame.errors[i])) / range;
    } else if (id === "coverage") {
        for (let i = 0; i < out.length; i++) out[i] = errorOf(frame.errors[i]) <= facts.cover ? 1 : 0;
    } else if (id === "seen" && part.seen) {
        const most = Math.max(1, facts.with_points ?? 1);
        for (let i = 0; i < out.length; i++) out[i] = part.seen[i] / most;
    } else {
        out.fill(0);
    }
}

/** {title, low, high, map} of the bar below the picture, or null. */
export function legendOf(id, range, capture) {
    const mode = modeOf(id);
    if (!mode.map) return null;
    const frames = capture.results[0]?.facts.parts[0]?.with_points ?? 0;
    const cover = 100 * (capture.results[0]?.facts.parts[0]?.cover ?? 0.01);
    const texts = {
        error: { title: "Vertex to nearest point, % of the diagonal", low: "0", high: `${range} or more` },
        stretch: { title: "Mean change of a vertex's edges", low: "-50 %", high: "+50 %" },
        coverage: {
            title: `A point within ${cover.toPrecision(2)} % of the diagonal`,
            low: "none",
            high: "covered",
        },
        seen: { title: "Frames that cover the vertex", low: "0", high: `${frames}` },
    };
    return { ...texts[id], map: mode.map };
}
