// The distance between two clicks on the surface; its ends move with it.
const element = (id) => document.getElementById(id);

export class Ruler {
    constructor(app) {
        this.app = app;
        this.isOn = false;
        this.ends = []; // hits of one result and one part
    }

    toggle() {
        this.clear();
        this.#setOn(!this.isOn);
    }

    clear() {
        this.ends = [];
        this.#setOn(false);
        this.update();
    }

    #setOn(isOn) {
        this.isOn = isOn;
        element("measure").setAttribute("aria-pressed", isOn);
        element("ruler").textContent = isOn ? "Click two places on the surface." : "";
    }

    /** A click on the surface, or beside it (null). */
    add(hit) {
        if (!hit) return;
        const { capture, player } = this.app;
        const end = { ...hit, store: capture.storeAt(player.slot, hit.result) };
        const isNew =
            this.ends.length !== 1 ||
            this.ends[0].result !== end.result ||
            this.ends[0].store !== end.store;
        this.ends = isNew ? [end] : [this.ends[0], end];
        this.update();
    }

    /** For the frame that is shown. */
    update() {
        const { app, ends } = this;
        app.stage.figures.forEach((figure, r) => {
            const own = ends.filter((end) => end.result === r && end.store === figure.store);
            const distance = figure.setRuler(own);
            if (ends[0]?.result !== r || ends.length < 2) return;
            const share = (100 * distance) / (figure.store?.facts.diagonal || 1);
            element("ruler").textContent =
                distance === null
                    ? "no distance in this frame"
                    : `${distance.toPrecision(4)} in the meshes' unit, ${share.toPrecision(3)} % of the diagonal`;
        });
        app.isDirty = true;
    }
}
