// What the page is of: results with their parts, and the frames of all of them on one time line.
import { LiveSource, PageSource, PartStore } from "./store.js";

/** A result: its facts, and a store for each part. */
class Result {
    constructor(facts, place, origin, isLive, before) {
        this.facts = facts;
        this.place = place;
        this.stores = facts.parts.map((part, i) => {
            const known = before?.stores[i];
            if (isLive && known && known.facts.id === part.id) {
                known.facts = known.source.facts = part;
                return known;
            }
            const source = isLive ? new LiveSource(i, part) : new PageSource(place, i);
            if (isLive) part.group = 1;
            const own = part.origin ?? [0, 0, 0];
            return new PartStore(
                source,
                part,
                own.map((x, a) => x - origin[a]),
            );
        });
        for (const part of facts.parts) if (isLive) part.group = 1;
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
    constructor() {
        this.results = [];
        this.slots = [];
    }

    /** Take over what a page or a server says; true where something is new. */
    take(facts) {
        this.isLive = facts.live;
        this.phase = facts.phase ?? null;
        this.problem = facts.problem ?? "";
        this.version = facts.neupig;
        this.origin = facts.results?.[0]?.parts?.[0]?.origin ?? [0, 0, 0];
        const shown = this.slots.length;
        const before = this.results;
        this.results = (facts.results ?? []).map(
            (r, i) => new Result(r, i, this.origin, facts.live, before[i]),
        );
        this.slots = slotsOf(this.results.filter((r) => r.facts.parts.length));
        return shown !== this.slots.length;
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
