// neupig view: the page.  Puts together what is shown, and listens.
import { followInAddress, goToAddress } from "./address.js";
import { Capture } from "./capture.js";
import { gradientOf, lackOf, legendOf, MODES } from "./colours.js";
import { listen, SPEEDS } from "./controls.js";
import { follow } from "./live.js";
import { historyOf, showFrame, showResult, showVertex } from "./panel.js";
import { fillColours, listMarks, namePanes, showBadge, wake } from "./labels.js";
import { Player } from "./player.js";
import { Ruler } from "./ruler.js";
import { Stage } from "./stage.js";
import { Timeline } from "./timeline.js";

const element = (id) => document.getElementById(id);
const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const SHADINGS = ["smooth", "flat", "wire"];

class App {
    constructor(facts) {
        this.capture = new Capture(facts);
        this.look = { shading: "smooth", colour: "plain", range: 1, mesh: true, opacity: 1, points: false };
        this.pick = null;
        this.isDirty = true;
        this.pictures = 0; // drawn so far
        this.shown = null; // what is on the screen: a slot's frames
    }

    /** Once there is a result. */
    begin() {
        const { capture } = this;
        this.stage = new Stage(
            element("canvas"),
            capture.results.length,
            capture.results[0].facts.up,
            () => (this.isDirty = true),
        );
        this.player = new Player(capture);
        this.timeline = new Timeline(element("timeline"), capture, (slot) => this.seek(slot));
        this.ruler = new Ruler(this);
        listen(this);
        this.setTheme(document.documentElement.dataset.theme);
        new ResizeObserver(() => this.resize()).observe(element("viewport"));
        this.resize();
        this.refreshFacts();
        this.seek(0);
        if (!capture.isLive) goToAddress(this);
        requestAnimationFrame((now) => this.#picture(now));
    }

    // ---- what is there ----

    refreshFacts() {
        const { capture } = this;
        const names = capture.results.map((result) => result.facts.name);
        document.title = `${names.join(" | ") || "neupig"} - neupig view`;
        element("name").textContent = names.join("  |  ");
        element("name").title = capture.results.map((result) => result.facts.path).join("\n");
        showResult(capture);
        showBadge(capture);
        namePanes(this);
        fillColours(this);
        listMarks(capture);
        const frames = capture.slots.flatMap((slot) => slot.at.map((at) => at?.frame)).filter(Boolean);
        element("bad").disabled = !frames.some((frame) => frame.good === false || frame.unexplained);
        this.timeline.update();
    }

    // ---- frames ----

    seek(slot) {
        const last = this.player.last;
        this.player.slot = Math.max(0, Math.min(last, slot));
        this.player.since = performance.now();
        this.isDue = true;
        this.timeline.seek(this.player.slot);
        this.#count();
        showFrame(this.capture, this.player.slot);
        this.#updatePick();
    }

    step(by) {
        this.play(false);
        const count = this.player.last + 1;
        const next = this.player.slot + by;
        this.seek(this.player.isLooping ? (next + count) % count : next);
    }

    play(isPlaying) {
        this.player.play(isPlaying);
        this.#showPlaying();
    }

    #showPlaying() {
        if (!this.player.isPlaying) this.#showFigures(performance.now());
        element("play").classList.toggle("playing", this.player.isPlaying);
        element("play").setAttribute("aria-label", this.player.isPlaying ? "Pause (space)" : "Play (space)");
    }

    #count() {
        const { slots } = this.capture;
        const number = document.createElement("b");
        number.textContent = slots[this.player.slot]?.number ?? "-";
        element("counter").replaceChildren(
            "frame ",
            number,
            ` \u00b7 ${this.player.slot + 1} of ${slots.length}`,
        );
    }

    /** Bring the frames of the slot to the screen; false while they are not decoded. */
    #showSlot(slot) {
        const { capture } = this;
        const frames = capture.results.map((_, r) => {
            const at = capture.slots[slot]?.at[r];
            const store = capture.storeAt(slot, r);
            return at ? { store, data: store.peek(at.place), hasMesh: at.frame.mesh } : null;
        });
        if (frames.some((frame) => frame && !frame.data)) return false;
        const isFirst = !this.shown;
        frames.forEach((frame, r) => this.stage.figures[r].show(frame?.store, frame?.data, frame?.hasMesh));
        this.shown = { slot, frames };
        if (isFirst) this.#firstLook();
        const lacking = frames
            .map((frame, r) => [
                r,
                !frame ? "not in this result" : frame.hasMesh ? "" : "no mesh in this frame",
            ])
            .filter(([, text]) => text);
        element("message").textContent = lacking
            .map(([r, text]) => (capture.results.length > 1 ? `${"AB"[r]}: ${text}` : text))
            .join(", ");
        this.#movePick();
        this.ruler.update();
        this.dress();
        return true;
    }

    #firstLook() {
        wake();
        element("progress").hidden = !this.capture.isLive;
        this.stage.fit([28, 14]);
        if (this.lookFrom) this.stage.lookFrom(this.lookFrom);
        if (!this.capture.isLive) followInAddress(this);
        this.stage.placeGrid(this.stage.bounds());
        fillColours(this);
    }

    dress() {
        const { colour } = this.look;
        const look = {
            ...this.look,
            opacity: this.look.mesh ? this.look.opacity : 0,
            plain: css("--surface") || "#b9c0cb",
            ground: css("--ground"),
            pointColour: colour === "plain" ? "#f08a1d" : css("--text"),
        };
        for (const figure of this.stage.figures) figure.dress(look);
        element("points-key").hidden = !look.points || !this.stage.figures.some((f) => f.dropped.visible);
        element("points-key").firstChild.style.setProperty("--mark", look.pointColour);
        const legend = legendOf(colour, look.range, this.capture);
        element("legend").hidden = !legend;
        if (legend) {
            element("legend-title").textContent = legend.title;
            element("legend-bar").style.background = gradientOf(legend.map);
            element("legend-low").textContent = legend.low;
            element("legend-high").textContent = colour === "error" ? "" : legend.high;
            element("legend-range").hidden = colour !== "error";
        }
        this.isDirty = true;
    }

    #picture(now) {
        if (this.player.tick(now)) {
            this.isDue = true;
            this.timeline.seek(this.player.slot);
            this.#count();
            this.#showFigures(now);
        }
        if (!this.player.isPlaying && element("play").classList.contains("playing")) this.#showPlaying();
        if (this.isDue && this.capture.slots.length) {
            if (this.#showSlot(this.player.slot)) this.isDue = false;
            else this.player.since = now;
        }
        this.#hurry(now);
        if (this.isDirty) {
            this.isDirty = false;
            this.drawnAt = now;
            this.stage.draw();
            this.pictures++;
            if (this.shown && !document.body.dataset.ready)
                document.body.dataset.ready = Math.round(performance.now());
        }
        requestAnimationFrame((next) => this.#picture(next));
    }

    /** While it plays nobody reads faster than this. */
    #showFigures(now) {
        if (this.player.isPlaying && now - (this.toldAt ?? 0) < 150) return;
        this.toldAt = now;
        showFrame(this.capture, this.player.slot);
        if (this.pick) showVertex(this.pick, this.#placeOfPick());
    }

    /** Where pictures take long, they get fewer pixels as long as something moves. */
    #hurry(now) {
        const isMoving = this.player.isPlaying || Boolean(this.stage.isTurning);
        if (isMoving !== this.wasMoving) this.isDirty = true;
        this.wasMoving = isMoving;
        this.stage.setMoving(isMoving);
        if (isMoving && this.isDirty && this.drawnAt) this.stage.noteTime(now - this.drawnAt);
    }

    // ---- the look ----

    setShading(shading) {
        this.look.shading = shading;
        for (const button of document.querySelectorAll("[data-shading]"))
            button.setAttribute("aria-pressed", button.dataset.shading === shading);
        this.dress();
    }

    setColour(id) {
        if (lackOf(id, this.capture)) return;
        this.look.colour = id;
        element("colour").value = id;
        this.dress();
    }

    setRange(range) {
        this.look.range = range;
        element("range").value = range;
        this.dress();
    }

    setPoints(isShown) {
        if (isShown && lackOf("points", this.capture)) return;
        this.look.points = isShown;
        element("points").setAttribute("aria-pressed", isShown);
        this.dress();
    }

    setMesh(isShown) {
        this.look.mesh = isShown;
        element("mesh").setAttribute("aria-pressed", isShown);
        this.dress();
    }

    setOpacity(opacity) {
        this.look.opacity = opacity;
        element("opacity").value = 100 * opacity;
        this.dress();
    }

    setGrid(isShown) {
        this.stage.setGrid(isShown);
        element("grid").setAttribute("aria-pressed", isShown);
        this.isDirty = true;
    }

    setTheme(theme) {
        document.documentElement.dataset.theme = theme;
        this.stage.setGround(css("--ground"), css("--grid"));
        this.timeline.draw();
        if (this.pick) showVertex(this.pick, this.#placeOfPick());
        this.dress();
    }

    setSpeed(speed) {
        this.player.speed = speed;
        this.player.since = performance.now();
        element("speed").value = speed;
    }

    setLoop(isLooping) {
        this.player.isLooping = isLooping;
        element("loop").setAttribute("aria-pressed", isLooping);
    }

    view(name) {
        this.stage.fit(name);
        this.isDirty = true;
    }

    resize() {
        this.stage.resize();
        this.timeline.draw();
        namePanes(this);
        this.isDirty = true;
    }

    setPanel(isShown) {
        document.querySelector("main").classList.toggle("wide", !isShown);
        element("toggle-panel").setAttribute("aria-expanded", isShown);
    }

    // ---- a vertex ----

    async pickAt(x, y) {
        const hit = this.stage.pick(x, y);
        if (this.ruler.isOn) return this.ruler.add(hit);
        return this.setPick(hit);
    }

    /** hit: {result, vertex}, or null. */
    async setPick(hit) {
        for (const figure of this.stage.figures) figure.setPick(null, null);
        const store = hit && this.capture.storeAt(this.player.slot, hit.result);
        this.pick = hit ? { ...hit, store, origin: this.capture.origin, history: null } : null;
        const { pick } = this;
        this.#updatePick();
        this.isDirty = true;
        if (!pick) return;
        this.stage.figures[hit.result].setPick(hit.vertex, null);
        pick.history = await historyOf(store, hit.vertex);
        if (this.pick !== pick) return;
        this.stage.figures[hit.result].setPick(hit.vertex, pick.history.way);
        this.#updatePick();
        this.isDirty = true;
    }

    #placeOfPick() {
        const at = this.capture.slots[this.player.slot]?.at[this.pick.result];
        return at && this.capture.storeAt(this.player.slot, this.pick.result) === this.pick.store
            ? at.place
            : 0;
    }

    #updatePick() {
        showVertex(this.pick, this.pick ? this.#placeOfPick() : 0);
    }

    #movePick() {
        if (!this.pick) return;
        const figure = this.stage.figures[this.pick.result];
        const isSame = this.capture.storeAt(this.player.slot, this.pick.result) === this.pick.store;
        figure.picked = isSame ? this.pick.vertex : null;
        figure.path.visible = isSame && Boolean(this.pick.history);
        figure.moveMark();
    }

    // ---- to frames that matter ----

    toWorst() {
        const worst = (slot) =>
            Math.max(-1, ...slot.at.map((at) => at?.frame.figures?.point_dist_median ?? -1));
        const { slots } = this.capture;
        this.play(false);
        this.seek(slots.reduce((best, slot, k) => (worst(slot) > worst(slots[best]) ? k : best), 0));
    }

    toBad(way = 1) {
        const { slots } = this.capture;
        const isBad = (slot) => slot.at.some((at) => at && (at.frame.good === false || at.frame.unexplained));
        for (let i = 1; i <= slots.length; i++) {
            const k = (((this.player.slot + way * i) % slots.length) + slots.length) % slots.length;
            if (!isBad(slots[k])) continue;
            this.play(false);
            return this.seek(k);
        }
    }

    toKey() {
        const k = this.capture.slots.findIndex((slot) => slot.at.some((at) => at?.frame.key));
        if (k >= 0) this.seek(k);
    }

    // ---- what keys ask for ----

    toggleTheme() {
        this.setTheme(document.documentElement.dataset.theme === "dark" ? "light" : "dark");
    }

    nextShading() {
        this.setShading(SHADINGS[(SHADINGS.indexOf(this.look.shading) + 1) % SHADINGS.length]);
    }

    nextColour() {
        const there = MODES.filter((mode) => !lackOf(mode.id, this.capture)).map((mode) => mode.id);
        this.setColour(there[(there.indexOf(this.look.colour) + 1) % there.length]);
    }

    nextSpeed(by) {
        this.setSpeed(
            SPEEDS[Math.max(0, Math.min(SPEEDS.length - 1, SPEEDS.indexOf(this.player.speed) + by))],
        );
    }
}

function fail(error) {
    console.error(error);
    element("message").textContent = `This page can't be shown: ${error.message}`;
}

function start() {
    const app = new App(JSON.parse(element("facts").textContent));
    window.neupig = app; // for tests and the curious
    if (app.capture.slots.length || !app.capture.isLive) app.begin();
    if (app.capture.isLive) follow(app);
}

addEventListener("unhandledrejection", (event) => fail(event.reason));
if (typeof DecompressionStream === "undefined") fail(new Error("the browser is too old"));
else Promise.resolve().then(start).catch(fail);
