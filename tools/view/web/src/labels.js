// Names, lists and marks around the picture that depend on what is shown.
import { lackOf, MODES } from "./colours.js";
import { marksOf } from "./timeline.js";

const element = (id) => document.getElementById(id);

/** Which pane is whose, where there are two. */
export function namePanes(app) {
    const { results } = app.capture;
    if (results.length < 2) return;
    const panes = app.stage.layout();
    const labels = results.map((result, r) => {
        const label = document.createElement("span");
        label.textContent = `${"AB"[r]}: ${result.facts.name}`;
        label.style.left = `${panes[r][0] + 10}px`;
        label.style.top = `${panes[r][1] + 10}px`;
        return label;
    });
    const rule = document.createElement("i");
    const [left, top] = panes[1];
    Object.assign(
        rule.style,
        left
            ? { left: `${left}px`, top: 0, width: "1px", height: "100%" }
            : { top: `${top}px`, left: 0, height: "1px", width: "100%" },
    );
    element("pane-names").replaceChildren(...labels, rule);
}

/** The colour modes; those without data are greyed, with the reason. */
export function fillColours(app) {
    const select = element("colour");
    select.replaceChildren(
        ...MODES.map((mode) => {
            const option = new Option(mode.label, mode.id);
            const lack = lackOf(mode.id, app.capture);
            option.disabled = Boolean(lack);
            option.title = lack;
            if (lack) option.textContent += " (none)";
            return option;
        }),
    );
    select.value = app.look.colour;
    const lacks = MODES.map((mode) => [mode.label, lackOf(mode.id, app.capture)]).filter(([, lack]) => lack);
    select.title = ["Colour by (C)", ...lacks.map(([label, lack]) => `${label}: ${lack}`)].join("\n");
    const noPoints = lackOf("points", app.capture);
    element("points").disabled = Boolean(noPoints);
    element("points").title = noPoints || "The frame's points (O)";
}

/** The key below the time line. */
export function listMarks(capture) {
    element("marks").replaceChildren(
        ...marksOf(capture).map(([colour, word]) => {
            const mark = document.createElement("span");
            mark.style.setProperty("--mark", `var(${colour})`);
            mark.textContent = word;
            return mark;
        }),
    );
}

/** One word on the result, beside its name. */
export function showBadge(capture) {
    const badge = element("badge");
    const frames = capture.results.flatMap((result) => result.facts.parts.flatMap((part) => part.frames));
    const faults = frames.filter((frame) => frame.good === false || frame.unexplained).length;
    const hasAlarm = capture.results.some((result) =>
        result.has((part) => Object.values(part.alarm ?? {}).some(Boolean)),
    );
    badge.hidden = !frames.length || capture.isLive;
    badge.className = `badge ${hasAlarm ? "bad" : faults ? "warn" : "good"}`;
    const isOpen = capture.results.some((result) => !result.facts.done);
    badge.textContent = `${isOpen ? "not finished, " : ""}${hasAlarm ? "alarm, " : ""}${faults ? `${faults} frames to look at` : "all frames good"}`;
}

/** Buttons are dead until there is something to press them for. */
export function wake() {
    for (const sleeping of document.querySelectorAll("[inert]")) sleeping.inert = false;
}
