// Colour modes: what a vertex is coloured by, from which numbers, and the legend that goes with it.
import { errorOf } from "./codec.js";

/** Stops of colour maps that keep their order in grey and for most who see colours differently (0xrrggbb). */
const MAPS = {
    diverging: [0x2166ac, 0x67a9cf, 0xf2f2f2, 0xef8a62, 0xb2182b],
    covered: [0xe07a3f, 0x3f8ec0],
    counts: [0x440154, 0x414487, 0x2a788e, 0x22a884, 0x7ad151, 0xfde725],
};

export const MODES = [
    { id: "plain", label: "Plain", shader: 0 },
    { id: "vertex", label: "Vertex colour", shader: 1 },
    { id: "identity", label: "Identity (checker)", shader: 2 },
    { id: "normal", label: "Normal", shader: 3 },
    { id: "error", label: "Error", shader: 4, map: "diverging" },
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
    const stops = [0, 0.25, 0.5, 0.75, 1].map((share) => css(colourAt(MAPS[name], share)));
    return `linear-gradient(90deg, ${stops.join(", ")})`;
}

export const ERROR_RANGES = [0.1, 0.25, 0.5, 1, 2, 5];
export const STRETCH_RANGE = 0.5;

const most = (capture, what) =>
    Math.max(...capture.results.flatMap((result) => result.facts.parts.map((part) => part[what] ?? 0)));
const NOISES = 3; // standard deviations: what noise alone hardly reaches

/** The noise of the points, per cent of the diagonal. */
export const noiseOf = (capture) => 100 * most(capture, "noise");

/** Ranges of errors to choose from, [per cent of the diagonal, label], and where to begin: what noise does not
 * explain, but not below the bar, under which a frame is good. */
export function errorRanges(capture) {
    const noise = Number((NOISES * noiseOf(capture)).toPrecision(2));
    const ranges = ERROR_RANGES.map((range) => [range, `${range} %`]);
    if (noise > 0) ranges.unshift([noise, `${NOISES} x noise, ${noise} %`]);
    const bar = most(capture, "bar");
    const first = noise >= bar ? noise : (ERROR_RANGES.find((range) => range >= bar) ?? ERROR_RANGES.at(-1));
    return { ranges, first };
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

function stretchOf(frame, edges) {
    const { ends, rest, count } = edges;
    const p = frame.positions;
    const out = new Float32Array(count.length);
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
    return out;
}

/** Fill out (V x 2: 0 to 1 along the mode's map, and 1; where it is not known 0, 0) for a frame. */
export function fillShares(out, id, frame, store, range) {
    const { part, facts } = store;
    let share = () => NaN;
    if (id === "stretch") {
        part.edges ??= edgesOf(part);
        const stretch = stretchOf(frame, part.edges);
        share = (i) => stretch[i];
    } else if (id === "error") {
        const clip = (x) => Math.min(Math.max(x, 0), 1);
        share = (i) => clip(0.5 + (50 * errorOf(frame.errors[i])) / range);
    } else if (id === "coverage") {
        share = (i) => frame.near[i];
    } else if (id === "seen" && part.seen) {
        const frames = Math.max(1, facts.with_points ?? 1);
        share = (i) => part.seen[i] / frames;
    }
    for (let i = 0; i < part.vertices; i++) {
        const at = share(i);
        out[2 * i] = at || 0;
        out[2 * i + 1] = Number.isNaN(at) ? 0 : 1;
    }
}

/** {title, low, high, map} of the bar below the picture, or null. */
export function legendOf(id, range, capture) {
    const mode = modeOf(id);
    if (!mode.map) return null;
    const frames = capture.results[0]?.facts.parts[0]?.with_points ?? 0;
    const cover = 100 * (capture.results[0]?.facts.parts[0]?.cover ?? 0.01);
    const texts = {
        error: {
            title: `Points inside, outside; % of the diagonal (noise ${noiseOf(capture).toPrecision(2)}). Grey: none near`,
            low: `${-range} or less`,
            high: `${range} or more`,
        },
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
