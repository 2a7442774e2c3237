// What the page is of: results with their parts, and the frames of all of them on one time line.
import { PageSource, PartStore } from "./store.js";

/** A result: its facts, and a store for each part. */
class Result {
    constructor(facts, place, origin) {
        this.facts = facts;
        this.place = place;
        this.stores = facts.parts.map((part, i) => {
            const own = part.origin ?? [0, 0, 0];
            return new PartStore(
                new PageSource(place, i),
                part,
                own.map((x, a) => x - origin[a]),
            );
        });
    }

    has(what) {
        return this.facts.parts.some(what);
    }
}

/** Frames of all results by number: {number, at: [{part, place, frame} or null, one for each result]}. */
function slotsOf(results) {
    const slots = new Map();
    results.forEach((result, r) => {
        result.facts.parts.forEach((part, p) => {
            part.frames.forEach((frame, place) => {
                const slot = slots.get(frame.number) ?? { number: frame.number, at: results.map(() => null) };
                slot.at[r] = { part: p, place, frame };
                slots.set(frame.number, slot);
            });
        });
    });
    return [...slots.values()].sort((a, b) => a.number - b.number);
}

export class Capture {
    constructor(facts) {
        this.isLive = facts.live;
        this.version = facts.neupig;
        this.origin = facts.results[0]?.parts[0]?.origin ?? [0, 0, 0];
        this.results = facts.results.map((r, i) => new Result(r, i, this.origin));
        const hasReference = this.results.some((result) => result.has((part) => part.vertices));
        this.slots = hasReference ? slotsOf(this.results) : [];
    }

    storeAt(slot, result) {
        const at = this.slots[slot]?.at[result];
        return at ? this.results[result].stores[at.part] : null;
    }

    frameAt(slot, result) {
        return this.slots[slot]?.at[result]?.frame ?? null;
    }

    get fps() {
        return this.results[0]?.facts.fps ?? 30;
    }

    get total() {
        return this.results[0]?.facts.parts.reduce((sum, part) => sum + part.frame_count, 0) ?? 0;
    }
}

/** Median distance of the points to the surface, per cent of the diagonal; null: not measured. */
export function errorPercent(frame) {
    const value = frame?.figures?.point_dist_median;
    return typeof value === "number" ? 100 * value : null;
}
