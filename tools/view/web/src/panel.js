// Details beside the picture: the frame, the vertex that was picked, what the run reports.
import { errorPercent } from "./capture.js";
import { errorOf } from "./codec.js";
import { wordsOf } from "./timeline.js";

const element = (id) => document.getElementById(id);
const percent = (share, digits = 3) =>
    typeof share === "number" ? `${(100 * share).toPrecision(digits)} %` : "-";

/** Rows of names and values as a table; texts stay texts. */
function tableOf(rows) {
    const table = document.createElement("table");
    for (const [name, value, className] of rows) {
        const row = table.insertRow();
        row.insertCell().textContent = name;
        const cell = row.insertCell();
        cell.textContent = value;
        if (className) cell.className = className;
    }
    return table;
}

function frameRows(frame) {
    const f = frame.figures ?? {};
    const words = wordsOf(frame).map(([, word]) => word);
    const error = errorPercent(frame);
    const verdict = frame.skipped
        ? ["skipped", "warn"]
        : frame.good === false
          ? ["below the bar", "warn"]
          : ["good", "good"];
    const rows = [["Verdict", ...verdict]];
    if (words.length) rows.push(["Marks", words.join(", ")]);
    rows.push(["Points", `${frame.points ?? "-"}`]);
    rows.push(["Error, median", error === null ? "not measured" : `${error.toPrecision(3)} %`]);
    rows.push(["Error, 95 of 100", percent(f.point_dist_p95)]);
    rows.push(["Vertex to point, mean", percent(f.vertex_dist_mean)]);
    rows.push(["Coverage", percent(f.coverage)]);
    rows.push(["Flipped faces", percent(f.flipped_share, 2)]);
    rows.push(["Stretched faces", percent(f.stretched_share, 2)]);
    rows.push(["Edges changed by", percent(f.edge_change)]);
    return rows;
}

export function showFrame(capture, slot) {
    const at = capture.slots[slot];
    element("frame-title").textContent = at ? `Frame ${at.number}` : "Frame";
    const tables = capture.results.flatMap((result, r) => {
        const frame = at?.at[r]?.frame;
        const table = frame ? tableOf(frameRows(frame)) : tableOf([["", "not in this result"]]);
        if (capture.results.length < 2) return [table];
        const name = document.createElement("p");
        name.className = "quiet";
        name.textContent = `${"AB"[r]}: ${result.facts.name}`;
        return [name, table];
    });
    element("frame-facts").replaceChildren(...tables);
}

export function showResult(capture) {
    const rows = capture.results.flatMap((result, r) => {
        const { facts } = result;
        const sum = (of) => facts.parts.reduce((all, part) => all + of(part), 0);
        const frames = facts.parts.flatMap((part) => part.frames);
        const good = frames.filter((frame) => frame.good).length;
        return [
            [capture.results.length > 1 ? "AB"[r] : "Folder", facts.path],
            ["Frames", `${frames.length}${facts.every ? `, every ${facts.every}th` : ""}, ${good} good`],
            ["Vertices, faces", facts.parts.map((part) => `${part.vertices}, ${part.faces}`).join("; ")],
            ["Segments", `${facts.parts.length}`],
            ["Windows", `${sum((part) => part.windows.length)}`],
            ["Frames per second", `${facts.fps}`],
        ];
    });
    rows.push(["Made by", `neupig ${capture.version}`]);
    element("result-facts").replaceChildren(tableOf(rows));
    showNotes(capture);
}

function notesOf(capture) {
    return capture.results.flatMap((result, r) => {
        const name = capture.results.length > 1 ? `${"AB"[r]}: ` : "";
        const alarms = result.facts.parts.flatMap((part) => Object.values(part.alarm ?? {})).filter(Boolean);
        const texts = alarms.map((alarm) => `Alarm from frame ${alarm.from_frame}: ${alarm.cause}`);
        for (const warning of result.facts.warnings.flat().slice(0, 50))
            texts.push(
                typeof warning === "string"
                    ? warning
                    : (warning.text ?? warning.message ?? JSON.stringify(warning)),
            );
        for (const part of result.facts.parts)
            if (part.no_points) texts.push(`Points not found: ${part.no_points}`);
        return texts.map((text) => name + text);
    });
}

function showNotes(capture) {
    const notes = notesOf(capture);
    element("notes-section").hidden = !notes.length;
    element("notes").replaceChildren(
        ...notes.map((text) => {
            const item = document.createElement("li");
            item.textContent = text;
            return item;
        }),
    );
}

/** The way and the errors of a vertex through all frames of its part. */
export async function historyOf(store, vertex) {
    const count = store.facts.frames.length;
    const way = new Float32Array(3 * count);
    const errors = new Float32Array(count);
    const hasPoints = !store.facts.no_points || store.facts.with_points > 0;
    await store.each((frame, place) => {
        way.set(frame.positions.subarray(3 * vertex, 3 * vertex + 3), 3 * place);
        errors[place] = hasPoints ? 100 * errorOf(frame.errors[vertex]) : NaN;
    });
    return { vertex, way, errors };
}

export function showVertex(pick, place) {
    const curve = element("vertex-curve");
    curve.hidden = !pick;
    if (!pick) {
        const text = document.createElement("p");
        text.className = "quiet";
        text.textContent = "Click the surface to follow a vertex.";
        element("vertex-facts").replaceChildren(text);
        return;
    }
    const { vertex, history } = pick;
    const rows = [["Number", `${vertex}`]];
    if (history) {
        const at = [0, 1, 2].map((a) => history.way[3 * place + a] + pick.origin[a]);
        rows.push(["Place", at.map((x) => x.toPrecision(5)).join(", ")]);
        rows.push(["Error in this frame", textOfError(history.errors[place])]);
        const known = history.errors.filter((x) => !Number.isNaN(x));
        if (known.length) {
            const sizes = known.map(Math.abs);
            rows.push(["Size, mean", textOfError(sizes.reduce((a, b) => a + b, 0) / known.length)]);
            rows.push(["Size, worst", textOfError(Math.max(...sizes))]);
        }
        rows.push(["Way in all frames", lengthOf(history.way).toPrecision(4)]);
        drawCurve(curve, history.errors.map(Math.abs), place, vertex);
    } else {
        rows.push(["", "reading all frames ..."]);
    }
    element("vertex-facts").replaceChildren(tableOf(rows));
}

const textOfError = (error) =>
    Number.isNaN(error)
        ? "no points near"
        : Math.abs(error) >= 5
          ? `${Math.sign(error) * 5} % or more`
          : `${error.toPrecision(2)} %`;

function lengthOf(way) {
    let sum = 0;
    for (let i = 3; i < way.length; i += 3)
        sum += Math.hypot(way[i] - way[i - 3], way[i + 1] - way[i - 2], way[i + 2] - way[i - 1]);
    return sum;
}

function drawCurve(canvas, errors, place, vertex) {
    const ratio = Math.min(window.devicePixelRatio || 1, 2);
    const style = getComputedStyle(document.documentElement);
    const css = (name) => style.getPropertyValue(name).trim();
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    canvas.width = width * ratio;
    canvas.height = height * ratio;
    const known = Array.from(errors).filter((x) => !Number.isNaN(x));
    const most = Math.max(...known, 1e-6) * 1.1;
    const c = canvas.getContext("2d");
    const x = (i) => 34 + ((width - 38) * i) / Math.max(1, errors.length - 1);
    const y = (e) => height - 4 - ((height - 10) * e) / most;
    c.setTransform(ratio, 0, 0, ratio, 0, 0);
    c.clearRect(0, 0, width, height);
    c.font = "10px system-ui, sans-serif";
    c.textAlign = "right";
    c.fillStyle = css("--quiet");
    c.fillText(`${(most / 1.1).toPrecision(2)} %`, 31, y(most / 1.1) + 4);
    c.fillText("0", 31, y(0) + 1);
    c.strokeStyle = css("--line");
    c.strokeRect(34, 4.5, width - 38, height - 8);
    c.strokeStyle = css("--accent");
    c.beginPath();
    errors.forEach((e, i) => (i ? c.lineTo(x(i), y(e)) : c.moveTo(x(i), y(e))));
    c.stroke();
    c.fillStyle = css("--bad");
    c.fillRect(x(place) - 0.75, 4, 1.5, height - 8);
    canvas.setAttribute(
        "aria-label",
        `Size of the error of vertex ${vertex} over ${errors.length} frames, at most ${(most / 1.1).toPrecision(2)} per cent of the diagonal`,
    );
}
