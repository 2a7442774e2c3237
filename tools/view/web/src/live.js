// A run at work: the page says how far it is, and loads itself again for what has come.
const EVERY_MS = 4000;

const element = (id) => document.getElementById(id);

function showProgress(capture) {
    const solved = capture.slots.length,
        { total } = capture;
    const share = total ? solved / total : 0;
    element("progress").hidden = false;
    element("progress-bar").firstChild.style.width = `${100 * share}%`;
    element("progress-bar").setAttribute("aria-valuenow", Math.round(100 * share));
    element("progress-text").textContent = solved
        ? `solving: ${solved}${total ? ` of ${total}` : ""} frames`
        : "choosing the reference";
    if (!solved) element("message").textContent = "No frame is solved yet.";
}

/** Where the page was before it was loaded again: its frame (null: the last), and where it was looked from. */
function placeOf(app) {
    const { player, stage } = app;
    if (!player) return null;
    return {
        number: player.slot === player.last ? null : app.capture.slots[player.slot].number,
        camera: stage.camera.position.toArray(),
        target: stage.controls.target.toArray(),
    };
}

function goTo(app, place) {
    const slot = app.capture.slots.findIndex((one) => one.number === place?.number);
    app.seek(slot < 0 ? app.player.last : slot);
    app.lookFrom = place;
}

/** What this page left for itself; null where it was just opened. */
function leftPlace() {
    try {
        return JSON.parse(window.name);
    } catch {
        return null;
    }
}

export function follow(app) {
    showProgress(app.capture);
    if (app.player) goTo(app, leftPlace());
    setInterval(() => {
        if (app.player?.isPlaying) return;
        window.name = JSON.stringify(placeOf(app));
        location.reload();
    }, EVERY_MS);
}
