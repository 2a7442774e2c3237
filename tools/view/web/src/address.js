// Frame, camera and colour in the page's address, so that a link leads to what somebody saw.
const REST_MS = 300; // nothing has moved for so long

const numbers = (text) => (text ?? "").split(",").map(Number);
const isPlace = (place) => place.length === 3 && place.every(Number.isFinite);

/** {number, camera, target, colour} of the address; null: it names none. */
export function placeInAddress() {
    const words = new URLSearchParams(location.hash.slice(1));
    const [camera, target] = [numbers(words.get("eye")), numbers(words.get("at"))];
    if (!words.has("frame") || !isPlace(camera) || !isPlace(target)) return null;
    return { number: Number(words.get("frame")), camera, target, colour: words.get("colour") };
}

function addressOf(app) {
    const { stage, capture, player, look } = app;
    const text = (vector) => vector.toArray().map((x) => Number(x.toPrecision(6))).join(",");
    const frame = capture.slots[player.slot]?.number ?? 0;
    return `#frame=${frame}&eye=${text(stage.camera.position)}&at=${text(stage.controls.target)}&colour=${look.colour}`;
}

export function goToAddress(app) {
    const place = placeInAddress();
    if (!place) return;
    const slot = app.capture.slots.findIndex((one) => one.number === place.number);
    if (slot >= 0) app.seek(slot);
    if (place.colour) app.setColour(place.colour);
    if (app.shown) app.stage.lookFrom(place);
    else app.lookFrom = place;
}

/** Keep the address at what is shown, once it rests. */
export function followInAddress(app) {
    let due = 0;
    let known = location.hash;
    setInterval(() => {
        if (!app.shown || app.player.isPlaying || app.stage.isTurning) return;
        const now = addressOf(app);
        if (now === known) return (due = 0);
        due += REST_MS / 2;
        if (due < REST_MS) return;
        known = now;
        due = 0;
        history.replaceState(null, "", now);
    }, REST_MS / 2);
    addEventListener("hashchange", () => {
        known = location.hash;
        goToAddress(app);
    });
}
