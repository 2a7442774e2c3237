// The time line: the curve of the error, and below it windows, segments and what the run says of each frame.
import { errorPercent } from "./capture.js";

const PAD = { left: 58, right: 10, top: 8 };
const CURVE_SHARE = 0.66; // of the height; the rest are strips

const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

/** Where the frames of a result stand on the line, for parts and their windows. */
function spansOf(capture, r) {
    const spans = capture.results[r].facts.parts.map(() => ({
        first: Infinity,
        last: -Infinity,
        windows: [],
    }));
    const byIndex = spans.map(() => []);
    capture.slots.forEach((slot, k) => {
        const at = slot.at[r];
        if (!at) return;
        spans[at.part].first = Math.min(spans[at.part].first, k);
        spans[at.part].last = Math.max(spans[at.part].last, k);
        byIndex[at.part].push([at.frame.index, k]);
    });
    spans.forEach((span, p) => {
        span.windows = capture.results[r].facts.parts[p].windows
            .map(([first, last]) =>
                byIndex[p].filter(([index]) => index >= first && index <= last).map(([, k]) => k),
            )
            .filter((places) => places.length)
            .map((places) => [places[0], places.at(-1)])
            .sort((a, b) => a[0] - b[0]);
    });
    return spans.filter((span) => span.last >= span.first);
}

/** Numbers of the frames from which a part's alarm counts. */
function alarmsOf(part) {
    return ["forward", "backward"]
        .map((way) => part.alarm?.[way])
        .filter((alarm) => alarm && typeof alarm === "object");
}

export class Timeline {
    constructor(element, capture, onSeek) {
        this.element = element;
        this.canvas = element.querySelector("canvas");
        this.tip = element.querySelector("#tip");
        this.capture = capture;
        this.onSeek = onSeek;
        this.current = 0;
        this.update();
        element.addEventListener("pointerdown", (event) => this.#press(event));
        element.addEventListener("pointermove", (event) => this.#hover(event));
        element.addEventListener("pointerleave", () => (this.tip.hidden = true));
    }

    /** New frames or another theme. */
    update() {
        const { results, slots } = this.capture;
        this.spans = results.map((_, r) => spansOf(this.capture, r));
        const errors = slots
            .flatMap((slot) => slot.at.map((at) => errorPercent(at?.frame)))
            .filter((x) => x !== null);
        this.bar = Math.max(0, ...results.flatMap((result) => result.facts.parts.map((part) => part.bar)));
        const worst = Math.max(0, ...errors);
        this.most = Math.max(1.12 * worst, worst > 0.4 * this.bar ? 1.12 * this.bar : 0) || 1;
        this.element.setAttribute("aria-valuemax", Math.max(0, slots.length - 1));
        this.draw();
    }

    #press(event) {
        this.element.setPointerCapture(event.pointerId);
        this.onSeek(this.#slotAt(event));
    }

    #hover(event) {
        const k = this.#slotAt(event);
        if (event.buttons & 1) this.onSeek(k);
        this.tip.textContent = this.#describe(k);
        this.tip.hidden = !this.capture.slots.length;
        const x = event.clientX - this.element.getBoundingClientRect().left;
        const width = this.tip.offsetWidth;
        this.tip.style.left = `${Math.min(Math.max(x - width / 2, 0), this.element.clientWidth - width)}px`;
    }

    #slotAt(event) {
        const x = event.clientX - this.element.getBoundingClientRect().left;
        const share = (x - PAD.left) / (this.element.clientWidth - PAD.left - PAD.right);
        const last = this.capture.slots.length - 1;
        return Math.max(0, Math.min(last, Math.round(share * last)));
    }

    #describe(k) {
        const slot = this.capture.slots[k];
        if (!slot) return "";
        const lines = slot.at.map((at, r) => {
            const error = errorPercent(at?.frame);
            const name = this.capture.results.length > 1 ? `${"AB"[r]}  ` : "";
            const words = wordsOf(at?.frame).map(([, word]) => word);
            return `${name}${error === null ? "not measured" : `${error.toPrecision(3)} %`}${words.length ? `  ${words.join(", ")}` : ""}`;
        });
        return [`Frame ${slot.number}`, ...lines].join("\n");
    }

    x(k) {
        const last = Math.max(1, this.capture.slots.length - 1);
        return PAD.left + (k / last) * (this.width - PAD.left - PAD.right);
    }

    seek(k) {
        this.current = k;
        const slot = this.capture.slots[k];
        this.element.setAttribute("aria-valuenow", k);
        this.element.setAttribute(
            "aria-valuetext",
            slot ? this.#describe(k).replaceAll("\n", ", ") : "no frame",
        );
        this.#drawHead();
    }

    /** All of it, after a change of frames, theme or size. */
    draw() {
        const ratio = Math.min(window.devicePixelRatio || 1, 2);
        this.width = this.element.clientWidth;
        this.height = this.element.clientHeight;
        this.canvas.width = Math.round(this.width * ratio);
        this.canvas.height = Math.round(this.height * ratio);
        this.still = document.createElement("canvas"); // what does not move with the frame
        this.still.width = this.canvas.width;
        this.still.height = this.canvas.height;
        this.text = css("--text");
        const c = this.still.getContext("2d");
        c.setTransform(ratio, 0, 0, ratio, 0, 0);
        c.font = "10.5px system-ui, sans-serif";
        this.floor = Math.round(this.height * CURVE_SHARE);
        this.#axis(c);
        this.#faults(c);
        this.capture.results.forEach((_, r) => this.#curve(c, r));
        this.#strips(c);
        this.#events(c);
        this.#drawHead();
    }

    /** The still picture, and where the frame is. */
    #drawHead() {
        const c = this.canvas.getContext("2d");
        c.setTransform(1, 0, 0, 1, 0, 0);
        c.clearRect(0, 0, this.canvas.width, this.canvas.height);
        if (this.still.width && this.still.height) c.drawImage(this.still, 0, 0);
        const ratio = this.canvas.width / Math.max(this.width, 1);
        c.setTransform(ratio, 0, 0, ratio, 0, 0);
        this.#playhead(c);
    }

    #y(error) {
        return this.floor - (error / this.most) * (this.floor - PAD.top);
    }

    #axis(c) {
        c.strokeStyle = css("--line");
        c.fillStyle = css("--quiet");
        c.textAlign = "right";
        c.textBaseline = "middle";
        for (const share of [0, 0.5, 1]) {
            const error = share * this.most,
                y = Math.round(this.#y(error)) + 0.5;
            line(c, PAD.left, y, this.width - PAD.right, y);
            c.fillText(share ? `${error.toPrecision(2)} %` : "0", PAD.left - 5, y);
        }
        if (!(this.bar > 0) || this.bar > this.most) return;
        c.strokeStyle = css("--warn");
        c.setLineDash([5, 4]);
        line(c, PAD.left, this.#y(this.bar), this.width - PAD.right, this.#y(this.bar));
        c.setLineDash([]);
        c.textAlign = "left";
        c.fillStyle = css("--warn");
        c.fillText("bar", PAD.left + 3, this.#y(this.bar) - 6);
    }

    /** Frames below the bar, unexplained or skipped, as columns behind the curve. */
    #faults(c) {
        const half = Math.max(1, (this.x(1) - this.x(0)) / 2);
        this.capture.slots.forEach((slot, k) => {
            const words = slot.at.flatMap((at) => wordsOf(at?.frame));
            const colour = words.find(([name]) => name)?.[0];
            if (!colour) return;
            c.fillStyle = css(colour);
            c.globalAlpha = 0.16;
            c.fillRect(this.x(k) - half, PAD.top, 2 * half, this.floor - PAD.top);
            c.globalAlpha = 1;
            c.fillRect(this.x(k) - half, this.floor - 3, 2 * half, 3);
        });
    }

    #curve(c, r) {
        c.strokeStyle = c.fillStyle = css(r ? "--curve-b" : "--accent");
        c.lineWidth = 1.5;
        c.beginPath();
        let isDown = false;
        this.capture.slots.forEach((slot, k) => {
            const error = errorPercent(slot.at[r]?.frame);
            if (error === null) return void (isDown = false);
            if (isDown) c.lineTo(this.x(k), this.#y(error));
            else c.moveTo(this.x(k), this.#y(error));
            if (!isDown) c.arc(this.x(k), this.#y(error), 0.5, 0, 7);
            isDown = true;
        });
        c.stroke();
        c.lineWidth = 1;
    }

    /** Windows, one row for each result; segments as blocks below them. */
    #strips(c) {
        const rows = this.spans.length,
            top = this.floor + 5;
        const size = Math.max(4, (this.height - top - 12) / rows - 2);
        this.spans.forEach((spans, r) => {
            const y = top + r * (size + 2);
            c.textAlign = "right";
            c.fillStyle = css("--quiet");
            c.fillText(rows > 1 ? `${"AB"[r]}` : "windows", PAD.left - 5, y + size / 2);
            spans.forEach((span, s) => {
                span.windows.forEach(([first, last], w) => {
                    c.fillStyle = css(r ? "--curve-b" : "--accent");
                    c.globalAlpha = w % 2 ? 0.55 : 0.28;
                    c.fillRect(
                        this.x(first),
                        y + (w % 2 ? size / 2 : 0),
                        Math.max(2, this.x(last) - this.x(first)),
                        size / 2 - 0.5,
                    );
                });
                c.globalAlpha = 1;
                if (spans.length < 2) return;
                c.strokeStyle = css("--text");
                c.strokeRect(
                    this.x(span.first) - 0.5,
                    y - 1.5,
                    Math.max(2, this.x(span.last) - this.x(span.first)) + 1,
                    size + 3,
                );
                if (s) line(c, this.x(span.first), PAD.top, this.x(span.first), y);
            });
        });
    }

    #events(c) {
        this.capture.slots.forEach((slot, k) => {
            if (slot.at.some((at) => at?.frame.key)) diamond(c, this.x(k), this.height - 6, css("--good"));
        });
        this.capture.results.forEach((result) =>
            result.facts.parts.flatMap(alarmsOf).forEach((alarm) => {
                const k = this.capture.slots.findIndex((slot) => slot.number === alarm.from_frame);
                if (k < 0) return;
                c.strokeStyle = c.fillStyle = css("--bad");
                c.lineWidth = 2;
                line(c, this.x(k), PAD.top, this.x(k), this.height);
                c.lineWidth = 1;
                const isLeft = this.x(k) > this.width - 70;
                c.textAlign = isLeft ? "right" : "left";
                c.fillText("alarm", this.x(k) + (isLeft ? -5 : 5), PAD.top + 6);
            }),
        );
    }

    #playhead(c) {
        if (!this.capture.slots.length) return;
        const x = this.x(this.current);
        c.strokeStyle = c.fillStyle = this.text;
        c.lineWidth = 1.5;
        line(c, x, 3, x, this.height);
        c.lineWidth = 1;
        c.beginPath();
        c.moveTo(x - 5, 0);
        c.lineTo(x + 5, 0);
        c.lineTo(x, 7);
        c.fill();
    }
}

function line(c, x0, y0, x1, y1) {
    c.beginPath();
    c.moveTo(x0, y0);
    c.lineTo(x1, y1);
    c.stroke();
}

function diamond(c, x, y, colour) {
    c.fillStyle = colour;
    c.beginPath();
    c.moveTo(x, y - 5);
    c.lineTo(x + 5, y);
    c.lineTo(x, y + 5);
    c.lineTo(x - 5, y);
    c.fill();
}

/** What is special about a frame: [colour of its mark or "", word]. */
export function wordsOf(frame) {
    if (!frame) return [];
    const words = [];
    if (frame.skipped) words.push(["--quiet", "skipped"]);
    else if (frame.good === false) words.push(["--warn", "below the bar"]);
    if (frame.unexplained) words.push(["--bad", "not explained by the reference"]);
    if (frame.held) words.push(["", "held"]);
    if (frame.key) words.push(["", "keyframe"]);
    return words;
}

/** The marks that this capture has, for the key below the line: [colour, word]. */
export function marksOf(capture) {
    const frames = capture.slots.flatMap((slot) => slot.at.map((at) => at?.frame)).filter(Boolean);
    const parts = capture.results.flatMap((result) => result.facts.parts);
    const names = capture.results.length > 1;
    return [
        [
            "--accent",
            names
                ? `error of A: ${capture.results[0].facts.name}`
                : "error: median distance of points to the surface",
            true,
        ],
        ["--curve-b", names ? `error of B: ${capture.results[1].facts.name}` : "", names],
        ["--good", "keyframe", frames.some((frame) => frame.key)],
        ["--warn", "below the bar", frames.some((frame) => frame.good === false && !frame.skipped)],
        [
            "--bad",
            "alarm, not explained",
            parts.some((part) => alarmsOf(part).length) || frames.some((frame) => frame.unexplained),
        ],
        ["--quiet", "skipped", frames.some((frame) => frame.skipped)],
    ].filter(([, , is]) => is);
}
