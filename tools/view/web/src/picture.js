// The picture as a file, and on the whole screen.
import { gradientOf, legendOf } from "./colours.js";

const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

/** The bar of the colours and what is shown, below the picture. */
function caption(c, app, width, top, unit) {
    const { capture, look, player } = app;
    const legend = legendOf(look.colour, look.range, capture);
    const names = capture.results.map((result) => result.facts.name).join(" | ");
    c.fillStyle = css("--panel");
    c.fillRect(0, top, width, 30 * unit);
    c.font = `${12 * unit}px system-ui, sans-serif`;
    c.textBaseline = "middle";
    c.fillStyle = css("--text");
    c.fillText(`${names}, frame ${capture.slots[player.slot]?.number ?? "-"}`, 10 * unit, top + 15 * unit);
    if (!legend) return;
    const stops = [...gradientOf(legend.map).matchAll(/rgb\([^)]*\)/g)].map(([stop]) => stop);
    const bar = c.createLinearGradient(width - 290 * unit, 0, width - 130 * unit, 0);
    stops.forEach((stop, i) => bar.addColorStop(i / (stops.length - 1), stop));
    c.textAlign = "right";
    c.fillText(legend.low, width - 296 * unit, top + 15 * unit);
    c.textAlign = "left";
    c.fillText(legend.high, width - 124 * unit, top + 15 * unit);
    c.fillStyle = bar;
    c.fillRect(width - 290 * unit, top + 9 * unit, 160 * unit, 12 * unit);
}

/** A canvas with the picture as it is drawn now, at all its pixels. */
export function pictureOf(app) {
    const { canvas } = app.stage;
    app.stage.setMoving(false);
    app.stage.draw();
    const unit = canvas.width / Math.max(canvas.clientWidth, 1);
    const whole = document.createElement("canvas");
    whole.width = canvas.width;
    whole.height = canvas.height + Math.round(30 * unit);
    const c = whole.getContext("2d");
    c.drawImage(canvas, 0, 0);
    caption(c, app, whole.width, canvas.height, unit);
    return whole;
}

export function savePicture(app) {
    const { capture, player } = app;
    const link = document.createElement("a");
    const name = capture.results.map((result) => result.facts.name).join("-");
    link.download = `${name}-${capture.slots[player.slot]?.number ?? 0}.png`;
    pictureOf(app).toBlob((blob) => {
        link.href = URL.createObjectURL(blob);
        link.click();
        setTimeout(() => URL.revokeObjectURL(link.href), 1000);
    });
}

export function toggleFullScreen() {
    if (document.fullscreenElement) document.exitFullscreen();
    else document.documentElement.requestFullscreen();
}
