// Buttons, lists and presses: what each does with the page.
import { errorRanges } from "./colours.js";
import { KEYS, listenToKeys } from "./keys.js";
import { savePicture, toggleFullScreen } from "./picture.js";

const element = (id) => document.getElementById(id);

export const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4];

export function listen(app) {
    const on = (id, event, act) => element(id).addEventListener(event, act);
    const { player } = app;
    on("play", "click", () => app.play(!player.isPlaying));
    on("first", "click", () => app.seek(0));
    on("last", "click", () => app.seek(player.last));
    on("back", "click", () => app.step(-1));
    on("next", "click", () => app.step(1));
    on("loop", "click", () => app.setLoop(!player.isLooping));
    on("worst", "click", () => app.toWorst());
    on("bad", "click", () => app.toBad());
    on("fit", "click", () => app.view(null));
    on("mesh", "click", () => app.setMesh(!app.look.mesh));
    on("opacity", "input", (event) => app.setOpacity(event.target.value / 100));
    on("measure", "click", () => app.ruler.toggle());
    on("png", "click", () => savePicture(app));
    on("full", "click", () => toggleFullScreen());
    element("full").disabled = !document.fullscreenEnabled;
    on("points", "click", () => app.setPoints(!app.look.points));
    on("grid", "click", () => app.setGrid(element("grid").getAttribute("aria-pressed") !== "true"));
    on("theme", "click", () => app.toggleTheme());
    on("help", "click", () => element("help-dialog").showModal());
    on("toggle-panel", "click", () =>
        app.setPanel(element("toggle-panel").getAttribute("aria-expanded") !== "true"),
    );
    on("colour", "change", (event) => app.setColour(event.target.value));
    on("range", "change", (event) => app.setRange(Number(event.target.value)));
    on("speed", "change", (event) => app.setSpeed(Number(event.target.value)));
    for (const button of document.querySelectorAll("[data-shading]"))
        button.addEventListener("click", () => app.setShading(button.dataset.shading));
    for (const button of document.querySelectorAll("[data-view]"))
        button.addEventListener("click", () => app.view(button.dataset.view));
    const { ranges, first } = errorRanges(app.capture);
    element("range").replaceChildren(...ranges.map(([range, label]) => new Option(label, range)));
    app.setRange(first);
    element("speed").replaceChildren(...SPEEDS.map((speed) => new Option(`${speed}\u00d7`, speed)));
    app.setSpeed(1);
    app.setShading("smooth");
    listenToPicks(app);
    listenToKeys(app);
    element("keys").replaceChildren(...KEYS.map(([keys, text]) => keyRow(keys, text)));
    if (innerWidth <= 720) app.setPanel(false);
}

/** A press that does not become a drag picks. */
function listenToPicks(app) {
    const canvas = element("canvas");
    let start = null;
    canvas.addEventListener(
        "pointerdown",
        (event) => (start = event.isPrimary && event.button === 0 ? [event.clientX, event.clientY] : null),
    );
    canvas.addEventListener("pointerup", (event) => {
        if (!start || Math.hypot(event.clientX - start[0], event.clientY - start[1]) > 4) return;
        const box = canvas.getBoundingClientRect();
        app.pickAt(event.clientX - box.left, event.clientY - box.top);
    });
}

function keyRow(keys, text) {
    const row = document.createElement("tr");
    const cell = row.insertCell();
    for (const key of keys) {
        const mark = document.createElement("kbd");
        mark.textContent = key;
        cell.append(mark, " ");
    }
    row.insertCell().textContent = text;
    return row;
}
