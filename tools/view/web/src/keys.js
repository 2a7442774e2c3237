// Keys, and the list of them that the help shows.
import { savePicture, toggleFullScreen } from "./picture.js";

export const KEYS = [
    [["Space"], "play or pause"],
    [["\u2190", "\u2192"], "one frame back or on; with Shift ten"],
    [["Home", "End"], "first and last frame"],
    [["K"], "keyframe"],
    [["W", "B"], "worst frame; next frame below the bar (Shift: the one before)"],
    [["+", "-"], "faster, slower"],
    [["L"], "loop"],
    [["1", "2", "3", "4", "5"], "from the front, right, back, left, top"],
    [["F"], "fit into view"],
    [["S", "C"], "next shading, next colour mode"],
    [["M", "O", "G"], "mesh, points, grid"],
    [["D"], "distance between two clicks"],
    [["P", "X"], "picture as PNG, full screen"],
    [["T"], "dark or light"],
    [["Esc"], "let go of the vertex and the distance"],
    [["?"], "this list"],
];

const VIEWS = ["front", "right", "back", "left", "top"];

/** What each key does with the page. */
function actionsOf(app) {
    const { player } = app;
    const actions = {
        " ": () => app.play(!player.isPlaying),
        arrowleft: (event) => app.step(event.shiftKey ? -10 : -1),
        arrowright: (event) => app.step(event.shiftKey ? 10 : 1),
        home: () => app.seek(0),
        end: () => app.seek(player.last),
        k: () => app.toKey(),
        w: () => app.toWorst(),
        b: (event) => app.toBad(event.shiftKey ? -1 : 1),
        "+": () => app.nextSpeed(1),
        "=": () => app.nextSpeed(1),
        "-": () => app.nextSpeed(-1),
        l: () => app.setLoop(!player.isLooping),
        f: () => app.view(null),
        s: () => app.nextShading(),
        c: () => app.nextColour(),
        m: () => app.setMesh(!app.look.mesh),
        o: () => app.setPoints(!app.look.points),
        d: () => app.ruler.toggle(),
        p: () => savePicture(app),
        x: () => toggleFullScreen(),
        g: () => document.getElementById("grid").click(),
        t: () => app.toggleTheme(),
        escape: () => {
            app.setPick(null);
            app.ruler.clear();
        },
        "?": () => document.getElementById("help-dialog").showModal(),
    };
    VIEWS.forEach((name, i) => (actions[`${i + 1}`] = () => app.view(name)));
    return actions;
}

export function listenToKeys(app) {
    const actions = actionsOf(app);
    document.addEventListener("keydown", (event) => {
        const { target, key } = event;
        if (event.ctrlKey || event.metaKey || event.altKey || document.querySelector("dialog[open]")) return;
        if (target instanceof HTMLSelectElement && key.length > 1 && key !== "Escape") return;
        if (target instanceof HTMLButtonElement && key === " ") return;
        const act = actions[key.toLowerCase()];
        if (!act) return;
        event.preventDefault();
        act(event);
    });
}
