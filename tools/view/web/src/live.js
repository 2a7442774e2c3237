// A run at work: ask its server how far it is, until it has ended.
const EVERY_MS = 1000;
const WORDS = {
    preparing: "choosing the reference",
    solving: "solving",
    writing: "writing the last files",
    done: "done",
    stopped: "stopped before its end",
};

const element = (id) => document.getElementById(id);
const wait = (milliseconds) => new Promise((resolve) => setTimeout(resolve, milliseconds));
const hasEnded = (capture) => ["done", "stopped"].includes(capture.phase);

function showProgress(capture) {
    const solved = capture.slots.length,
        { total } = capture;
    const share = total ? solved / total : 0;
    element("progress").hidden = false;
    element("progress-bar").firstChild.style.width = `${100 * share}%`;
    element("progress-bar").setAttribute("aria-valuenow", Math.round(100 * share));
    element("progress-text").textContent =
        `${WORDS[capture.phase] ?? ""}: ${solved}${total ? ` of ${total}` : ""} frames`;
}

/** Take what is new; who looks at the last frame goes on looking at the last. */
function take(app, state, showBadge) {
    const { capture } = app;
    const number = capture.slots[app.player?.slot]?.number;
    const wasLast = app.player && app.player.slot === app.player.last;
    const before = capture.slots.length;
    capture.take(state);
    showProgress(capture);
    const hasReference = capture.results.some((result) => result.facts.parts.some((part) => part.vertices));
    if (!hasReference || !capture.slots.length) {
        element("message").textContent = capture.problem || "No frame is solved yet.";
        return;
    }
    if (!app.stage) {
        app.begin();
        return app.seek(app.player.last);
    }
    app.refreshFacts();
    showBadge(capture);
    if (capture.slots.length === before || app.player.isPlaying) return;
    const same = capture.slots.findIndex((slot) => slot.number === number);
    app.seek(wasLast || same < 0 ? app.player.last : same);
}

/** Every frame, while the server is still there. */
async function fetchAll(capture) {
    for (const result of capture.results)
        for (const store of result.stores)
            for (let i = 0; i < store.facts.frames.length; i++) await store.source.groupBytes(i);
}

export async function follow(app, showBadge) {
    const { capture } = app;
    for (let failures = 0; failures < 5;) {
        try {
            const reply = await fetch("/state");
            if (!reply.ok) throw new Error(`state: ${reply.status}`);
            take(app, await reply.json(), showBadge);
            failures = 0;
        } catch (error) {
            failures++;
            if (failures === 5) element("progress-text").textContent = "the server has ended";
        }
        if (hasEnded(capture)) {
            await fetchAll(capture);
            document.body.dataset.ended = capture.phase;
            return;
        }
        await wait(EVERY_MS);
    }
}
