// Frames on demand: blocks are decoded when they are needed, and only so many stay decoded.
import { bytesOfBase64, readGroup, readPart } from "./codec.js";

const BYTES_AT_MOST = 192 << 20; // of decoded frames of one part

/** Blocks that lie in the page itself, as text. */
export class PageSource {
    constructor(result, part) {
        this.id = `data-${result}-${part}`;
    }
    async partBytes() {
        return this.#block(this.id);
    }
    async groupBytes(group) {
        return this.#block(`${this.id}-${group}`);
    }
    #block(id) {
        const element = document.getElementById(id);
        if (!element) throw new Error(`the page has no block ${id}`);
        return bytesOfBase64(element.textContent);
    }
}

const nextTask = () => new Promise((resolve) => setTimeout(resolve, 0));

/** A pause once so many milliseconds are used, so that pictures come out in between. */
function pacer(milliseconds) {
    let since = performance.now();
    return async () => {
        if (performance.now() - since < milliseconds) return;
        await nextTask();
        since = performance.now();
    };
}

/** The frames of one part. */
export class PartStore {
    constructor(source, facts, offset) {
        this.source = source;
        this.facts = facts;
        this.offset = offset;
        this.size = facts.group; // frames of a group
        this.groups = new Map(); // number -> {frames, promise}; the last used comes last
    }

    open() {
        this.opening ??= this.source.partBytes().then(async (bytes) => {
            this.part = await readPart(bytes, this.offset);
            const bytesOfGroup = this.size * (14 * this.part.vertices + 12 * 4000);
            this.most = Math.max(3, Math.floor(BYTES_AT_MOST / bytesOfGroup));
        });
        return this.opening;
    }

    /** The frame if it is decoded, else null; it and the next group are then on their way. */
    peek(place) {
        const group = Math.floor(place / this.size);
        const entry = this.#want(group);
        const last = Math.ceil(this.facts.frames.length / this.size) - 1;
        if (entry.frames && group < last) this.#want(group + 1);
        return entry.frames ? entry.frames[place - group * this.size] : null;
    }

    async frame(place) {
        await this.open();
        const group = Math.floor(place / this.size);
        const frames = await this.#want(group).promise;
        return frames[place - group * this.size];
    }

    /** Every frame in turn, without keeping them. */
    async each(visit) {
        await this.open();
        const pause = pacer(8);
        for (let first = 0; first < this.facts.frames.length; first += this.size) {
            const known = this.groups.get(first / this.size)?.frames;
            const frames = known ?? (await this.#read(first / this.size, pause));
            for (let i = 0; i < frames.length; i++) visit(frames[i], first + i);
            await pause();
        }
    }

    async #read(group, pause) {
        return readGroup(await this.source.groupBytes(group), this.part, pause);
    }

    #want(group) {
        let entry = this.groups.get(group);
        if (entry) {
            this.groups.delete(group);
        } else {
            entry = { frames: null };
            entry.promise = this.open()
                .then(() => this.#read(group, pacer(6)))
                .then((frames) => (entry.frames = frames));
            entry.promise.catch(() => this.groups.delete(group));
        }
        this.groups.set(group, entry);
        if (this.most && this.groups.size > this.most) this.groups.delete(this.groups.keys().next().value);
        return entry;
    }
}
