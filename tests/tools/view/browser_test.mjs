// The page in a real browser.
//
//     node browser_test.mjs MODULES BROWSER TEST ARGUMENTS...
//
//     figures PAGE RUN        curve and marks are those of frames.jsonl, decoded positions those of the meshes
//     looks PAGE              each colour mode and shading changes the picture; points, views, fit, themes, a vertex
//     plays PAGE              play, pause, scrub, step, speed, loop, by buttons, mouse and keys
//     tools PAGE              mesh, opacity, points alone, a distance, PNG, the address, full screen
//     loading PAGE            half of the page has come: progress, and dead buttons; then the rest
//     picture PAGE STORED     a known frame looks as it did (WRITE=1 in the environment stores it)
//     compare PAGE            two results on one time line
//     phone PAGE              at the width of a phone
//     names PAGE              hostile names are shown as text
//     live PAGE RUN PID       the page of a run at work shows more and more of it, until process PID ends
import fs from "node:fs";
import http from "node:http";
import path from "node:path";
import { execFileSync } from "node:child_process";
import { pathToFileURL } from "node:url";
import { compare, openBrowser, openPage, pictureOf, ready, shows } from "./open_browser.mjs";
import { readPly } from "./page_file.mjs";

const [modules, program, name, where, ...rest] = process.argv.slice(2);
const url = pathToFileURL(path.resolve(where)).href;

function expect(condition, text) {
    if (condition) return;
    throw new Error(typeof text === "string" ? text : JSON.stringify(text));
}

const linesOf = (run) =>
    fs
        .readFileSync(path.join(run, "frames.jsonl"), "utf8")
        .trim()
        .split("\n")
        .map((line) => JSON.parse(line));
const state = (page, expression) => page.evaluate(expression);

async function figures(page, [run]) {
    const lines = linesOf(run);
    const curve = await state(page, () =>
        window.neupig.capture.slots.map((slot) => slot.at[0].frame.figures.point_dist_median),
    );
    expect(
        String(curve) === String(lines.map((line) => line.figures.point_dist_median)),
        "the curve is not that of frames.jsonl",
    );
    const marks = await state(page, () => document.getElementById("marks").textContent);
    for (const word of ["keyframe", "below the bar", "alarm", "skipped"])
        expect(marks.includes(word), `no mark: ${word}`);
    const windows = await state(page, () => window.neupig.timeline.spans[0][0].windows.length);
    expect(windows > 1, `${windows} windows`);
    expect(
        (await state(page, () => document.getElementById("notes").textContent)).includes("Alarm from frame"),
        "the alarm is not told",
    );
    for (const line of lines.filter((l) => l.file)) {
        const { positions } = readPly(path.join(run, line.file));
        const shown = await state(
            page,
            `(async () => {
            const frame = await neupig.capture.results[0].stores[0].frame(${line.index});
            return Array.from(frame.positions, (x, i) => x + neupig.capture.origin[i % 3]);
        })()`,
        );
        const worst = shown.reduce((most, x, i) => Math.max(most, Math.abs(x - positions[i])), 0);
        expect(shown.length === positions.length && worst < 2e-5, `frame ${line.number}: off by ${worst}`);
    }
    await page.locator("#timeline").hover({ position: { x: 200, y: 20 } });
    const tip = await state(page, () => document.getElementById("tip").textContent);
    const number = Number(/^Frame (\d+)/.exec(tip)?.[1]);
    expect(tip.includes(`${(100 * lines[number].figures.point_dist_median).toPrecision(3)} %`), tip);
}

async function looks(page) {
    const seen = new Map();
    async function isNew(what) {
        const picture = await pictureOf(page);
        const twin = [...seen].find(([, other]) => other === picture)?.[0];
        expect(!twin, `${what} looks as ${twin}`);
        seen.set(what, picture);
    }
    await isNew("plain");
    const modes = await page
        .locator("#colour option")
        .evaluateAll((all) => all.map((o) => [o.value, o.disabled]));
    expect(
        modes.length === 8 &&
            modes
                .filter(([, isOff]) => isOff)
                .map(([id]) => id)
                .join() === "vertex",
        modes,
    );
    for (const [id] of modes.filter(([mode, isOff]) => !isOff && mode !== "plain")) {
        await page.selectOption("#colour", id);
        await isNew(id);
        expect(
            (await page.locator("#legend").isVisible()) ===
                ["error", "stretch", "coverage", "seen"].includes(id),
            `legend of ${id}`,
        );
    }
    await page.selectOption("#colour", "error");
    await page.selectOption("#range", "0.1");
    expect((await page.locator("#legend-low").textContent()) === "-0.1 or less", "another range");
    await page.selectOption("#colour", "plain");
    for (const shading of ["flat", "wire"]) {
        await page.click(`[data-shading=${shading}]`);
        await isNew(shading);
    }
    await page.click("[data-shading=smooth]");
    await page.click("#points");
    await isNew("points");
    await page.click("#points");
    for (const view of ["front", "right", "back", "left", "top"]) {
        await page.click(`[data-view=${view}]`);
        await isNew(view);
    }
    await page.click("#grid");
    await isNew("no grid");
    await page.click("[data-view=front]");
    const box = await page.locator("#canvas").boundingBox();
    const middle = [box.x + box.width / 2, box.y + box.height / 2];
    await page.mouse.click(...middle);
    await page.waitForFunction(() => window.neupig.pick?.history, null, { timeout: 30000 });
    const facts = await state(page, () => document.getElementById("vertex-facts").textContent);
    const vertex = await state(page, () => window.neupig.pick.vertex);
    expect(facts.includes(`Number${vertex}`) && facts.includes("Error in this frame"), facts);
    expect(await page.locator("#vertex-curve").isVisible(), "no curve of the vertex");
    await isNew("a vertex");
    await page.keyboard.press("Escape");
    expect((await state(page, () => window.neupig.pick)) === null, "the vertex is still marked");
    await page.mouse.move(...middle);
    await page.mouse.down();
    await page.mouse.move(middle[0] + 80, middle[1] + 30, { steps: 4 });
    await page.mouse.up();
    await isNew("orbited");
    const orbited = await pictureOf(page);
    await page.mouse.wheel(0, 300);
    await page.waitForTimeout(100);
    await isNew("zoomed");
    await page.keyboard.press("f");
    expect((await pictureOf(page)) === orbited, "fitting brings the distance back, and the side stays");
    await page.click("#theme");
    await isNew("dark");
}

async function plays(page) {
    const slot = () => state(page, () => window.neupig.player.slot);
    const last = await state(page, () => window.neupig.player.last);
    const first = await pictureOf(page);
    await page.click("#play");
    await page.waitForFunction(() => window.neupig.player.slot > 3, null, { timeout: 30000 });
    await page.click("#play");
    const paused = await slot();
    await page.waitForTimeout(300);
    expect((await slot()) === paused, "it goes on after pause");
    await shows(page, paused);
    expect((await pictureOf(page)) !== first, "playing changed nothing");
    await page.keyboard.press("Home");
    await shows(page, 0);
    expect((await pictureOf(page)) === first, "the first frame looks otherwise the second time");
    await page.click("#back");
    expect((await slot()) === last, "a step back from the first frame is the last one");
    await page.keyboard.press("ArrowRight");
    expect((await slot()) === 0, "a step on from the last frame is the first one");
    await page.keyboard.press("l");
    await page.keyboard.press("ArrowLeft");
    expect((await slot()) === 0, "without the loop it stays at the first frame");
    await page.keyboard.press("Shift+ArrowRight");
    expect((await slot()) === 10, "ten on");
    await page.keyboard.press("k");
    expect(
        await state(page, () => window.neupig.capture.slots[window.neupig.player.slot].at[0].frame.key),
        "to the keyframe",
    );
    await page.keyboard.press("w");
    expect((await slot()) === 3, "to the worst frame");
    await page.click("#bad");
    expect((await slot()) === last - 1, "to the next below the bar");
    await shows(page, last - 1);
    expect(
        (await state(page, () => document.getElementById("message").textContent)) === "no mesh in this frame",
        "no mesh",
    );
    const line = await page.locator("#timeline").boundingBox();
    await page.mouse.move(line.x + 100, line.y + 30);
    await page.mouse.down();
    await page.mouse.move(line.x + line.width / 2, line.y + 30, { steps: 5 });
    const middle = await slot();
    await page.mouse.move(line.x + line.width - 2, line.y + 30, { steps: 5 });
    await page.mouse.up();
    expect(
        middle > 3 && middle < last && (await slot()) === last,
        `scrubbed to ${middle}, then ${await slot()}`,
    );
    expect(
        Number(await page.locator("#timeline").getAttribute("aria-valuenow")) === last,
        "the slider's value",
    );
    expect(
        (await page.locator("#timeline").getAttribute("aria-valuetext")).startsWith(`Frame ${last}`),
        "the slider's text",
    );
    await page.selectOption("#speed", "4");
    await page.keyboard.press("Home");
    await page.locator("#canvas").focus();
    await page.keyboard.press(" ");
    await page.waitForFunction(() => !window.neupig.player.isPlaying, null, { timeout: 30000 }); // no loop: it ends
    expect((await slot()) === last, "it ends with the last frame");
    await page.keyboard.press("-");
    expect((await state(page, () => window.neupig.player.speed)) === 2, "slower");
    await page.keyboard.press("?");
    expect(await page.locator("#help-dialog").isVisible(), "no help");
    await page.keyboard.press("Escape");
    for (const id of ["first", "back", "play", "next", "last", "theme", "help"])
        expect(
            await page.locator(`#${id}`).getAttribute("aria-label"),
            `${id} has no name for screen readers`,
        );
}

async function tools(page) {
    await page.click("[data-view=front]");
    const whole = await pictureOf(page);
    await page.click("#points");
    const both = await pictureOf(page);
    await page.locator("#opacity").fill("30");
    const clear = await pictureOf(page);
    await page.click("#mesh");
    const alone = await pictureOf(page);
    expect(new Set([whole, both, clear, alone]).size === 4, "mesh, with points, seen through, points alone");
    expect(await state(page, () => !window.neupig.stage.figures[0].surface.visible), "the mesh is hidden");
    await page.keyboard.press("m");
    await page.locator("#opacity").fill("100");
    expect((await pictureOf(page)) === both, "it comes back as it was");
    // the distance between two clicks is that of the places on the surface, and moves with it
    await page.click("#measure");
    const box = await page.locator("#canvas").boundingBox();
    const x = box.x + box.width / 2;
    await page.mouse.click(x, box.y + 0.4 * box.height);
    await page.mouse.click(x, box.y + 0.6 * box.height);
    const told = await page.locator("#ruler").textContent();
    const ends = await state(page, () => {
        const { ends, app } = window.neupig.ruler;
        return ends.map((end) => app.stage.figures[0].placeOf(end));
    });
    const distance = Math.hypot(...ends[0].map((c, a) => c - ends[1][a]));
    expect(distance > 0.05 && told.startsWith(`${distance.toPrecision(4)} in`), `${told}, not ${distance}`);
    await state(page, () => window.neupig.seek(9));
    await shows(page, 9);
    expect((await page.locator("#ruler").textContent()) !== told, "the distance does not follow the surface");
    await page.keyboard.press("Escape");
    expect(await page.locator("#ruler").isHidden(), "the distance stays");
    // a link leads to the same frame, side and colour
    await page.selectOption("#colour", "error");
    await page.click("#grid"); // it lies below the frame that was seen first
    await page.click("[data-view=left]");
    await page.waitForFunction(
        () => {
            const x = Number(window.neupig.stage.camera.position.x.toPrecision(6));
            return location.hash.startsWith(`#frame=9&eye=${x},`) && location.hash.endsWith("colour=error");
        },
        null,
        { timeout: 10000 },
    );
    const link = page.url();
    const seen = await pictureOf(page);
    await page.goto("about:blank");
    await page.goto(link);
    await ready(page);
    await shows(page, 9);
    await page.click("#points");
    await page.click("#grid");
    const other = await compare(page, await pictureOf(page), seen);
    expect(other.mean < 0.5, `a link leads elsewhere: ${JSON.stringify(other)}`);
    const [download] = await Promise.all([page.waitForEvent("download"), page.click("#png")]);
    expect(download.suggestedFilename() === "made-9.png", download.suggestedFilename());
    const bytes = fs.readFileSync(await download.path());
    const size = [bytes.readUInt32BE(16), bytes.readUInt32BE(20)];
    const canvas = await state(page, () => [window.neupig.stage.canvas.width, window.neupig.stage.canvas.height]);
    expect(size[0] === canvas[0] && size[1] === canvas[1] + 30, `${size}, the canvas has ${canvas}`);
    await page.click("#full");
    await page.waitForFunction(() => document.fullscreenElement, null, { timeout: 10000 });
    await page.keyboard.press("x");
    await page.waitForFunction(() => !document.fullscreenElement, null, { timeout: 10000 });
}

async function loading(page) {
    const text = fs.readFileSync(path.resolve(where), "utf8");
    const cut = text.indexOf("<script", text.indexOf('id="data-0-0-1"')); // 16 of 20 frames are there, then all
    let finish;
    const server = http.createServer((request, response) => {
        response.writeHead(200, { "content-type": "text/html" });
        response.write(text.slice(0, cut));
        finish = () => response.end(text.slice(cut));
    });
    await new Promise((resolve) => server.listen(0, "127.0.0.1", resolve));
    await page.goto(`http://127.0.0.1:${server.address().port}/view.html`, { waitUntil: "commit" });
    const progress = page.locator("#progress-text");
    await progress.filter({ hasText: "loading 100 %" }).waitFor({ timeout: 20000 });
    const isDead = () =>
        state(page, () => ["#tools", "footer", "header .buttons"].map((at) => document.querySelector(at).inert));
    expect(String(await isDead()) === "true,true,true", `live before there is anything: ${await isDead()}`);
    finish();
    await ready(page);
    expect(String(await isDead()) === "false,false,false", `dead although all is there: ${await isDead()}`);
    expect(await page.locator("#progress").isHidden(), "the progress stays");
    server.close();
}

async function picture(page, [stored]) {
    await state(page, () => {
        const app = window.neupig;
        app.setPanel(false);
        app.setColour("identity");
        app.seek(7);
    });
    await shows(page, 7);
    await state(page, () => window.neupig.view("front"));
    const now = await pictureOf(page);
    if (process.env.WRITE) fs.writeFileSync(stored, Buffer.from(now.split(",")[1], "base64"));
    const then = `data:image/png;base64,${fs.readFileSync(stored).toString("base64")}`;
    const difference = await compare(page, now, then);
    expect(difference.mean < 1.5 && difference.share < 0.01, difference);
    await state(page, () => window.neupig.seek(0));
    await shows(page, 0);
    const other = await compare(page, await pictureOf(page), then);
    expect(other.share > 0.01, `another frame passes for this one: ${JSON.stringify(other)}`);
}

async function compareResults(page) {
    const names = await page.locator("#pane-names span").allTextContents();
    expect(names.length === 2 && names[0].startsWith("A: ") && names[1].startsWith("B: "), names);
    const halves = () =>
        state(page, () => {
            const app = window.neupig;
            app.stage.draw();
            const canvas = document.getElementById("canvas");
            return [0, 1].map((side) => {
                const half = document.createElement("canvas");
                [half.width, half.height] = [canvas.width / 2, canvas.height];
                half.getContext("2d").drawImage(canvas, (-side * canvas.width) / 2, 0);
                return half.toDataURL();
            });
        });
    const before = await halves();
    await state(page, () => window.neupig.seek(5));
    await shows(page, 5);
    const after = await halves();
    expect(before[0] !== after[0] && before[1] !== after[1], "both move");
    await page.keyboard.press("2");
    const turned = await halves();
    expect(turned[0] !== after[0] && turned[1] !== after[1], "both turn");
    const last = await state(page, () => window.neupig.player.last);
    await page.keyboard.press("End");
    await shows(page, last);
    expect(
        (await page.locator("#message").textContent()) === "B: not in this result",
        "a frame that only one has",
    );
}

async function phone(page) {
    const wide = await state(page, () => document.documentElement.scrollWidth);
    expect(wide <= 390, `${wide} pixels wide`);
    for (const id of ["canvas", "play", "timeline", "colour"]) {
        const box = await page.locator(`#${id}`).boundingBox();
        expect(
            box && box.x >= 0 && box.y >= 0 && box.x < 390 && box.y + box.height <= 845,
            `${id}: ${JSON.stringify(box)}`,
        );
    }
    expect((await page.locator("#canvas").boundingBox()).height > 300, "the picture is small");
    const cut = await page
        .locator("#tools > *, #tools button, #transport > *")
        .evaluateAll((all) => all.filter((e) => e.getBoundingClientRect().right > 391).map((e) => e.outerHTML));
    expect(!cut.length, `beyond the right edge: ${cut}`);
    const before = await pictureOf(page);
    await page.tap("#next");
    await shows(page, 1);
    expect((await pictureOf(page)) !== before, "a tap does nothing");
    await page.tap("#toggle-panel");
    expect(await page.locator("#frame-facts").isVisible(), "no details");
}

async function names(page) {
    expect((await state(page, () => document.title)).includes("<img src=x"), "the title");
    expect(
        (await page.locator("#name").textContent()).includes("<img src=x onerror=alert(1)>"),
        "the heading",
    );
    expect((await page.locator("img, iframe, link, object").count()) === 0, "an element came from a name");
    expect((await page.locator("#notes").textContent()).includes("</script><script>"), "the warning");
    expect((await page.locator("#notes b").count()) === 0, "an element came from the alarm");
}

async function live(page, [run, pid]) {
    const shown = (count) =>
        page.waitForFunction(
            (n) => window.neupig?.capture.slots.length === n && window.neupig.shown?.slot === n - 1,
            count,
            { timeout: 60000 },
        );
    await shown(2);
    /* A frame is there before the page has done loading, and says how the run goes on. */
    await page.waitForFunction(
        () => document.getElementById("progress-text").textContent === "solving: 2 of 6 frames",
        null,
        { timeout: 60000 },
    );
    const before = await pictureOf(page);
    const lines = fs.readFileSync(path.join(run, "all.jsonl"), "utf8").trim().split("\n");
    fs.writeFileSync(
        path.join(run, "frames.partial.jsonl"),
        [3, 2, 1, 5].map((i) => `${lines[i]}\n`).join(""),
    );
    await shown(4); // it was at the last frame, and stays there
    expect((await pictureOf(page)) !== before, "the new frame is not shown");
    fs.copyFileSync(path.join(run, "all.jsonl"), path.join(run, "frames.jsonl"));
    fs.copyFileSync(path.join(run, "done.later"), path.join(run, "done.json"));
    execFileSync("pkill", ["-P", pid]);
    await page.waitForFunction(() => window.neupig?.capture.isLive === false, null, { timeout: 60000 });
    expect(await page.locator("#progress").isHidden(), "the end");
}

const tests = { figures, looks, plays, tools, loading, picture, compare: compareResults, phone, names, live };
const sizes = { picture: { width: 480, height: 480 }, phone: { width: 390, height: 844 } };
const browser = await openBrowser(modules, program);
try {
    const options = name === "phone" ? { hasTouch: true, isMobile: true } : {};
    const page = await openPage(browser, url, sizes[name], options);
    if (name !== "live") await ready(page);
    console.log(
        `${name}: the first picture after ${await state(page, () => document.body.dataset.ready ?? "?")} ms`,
    );
    await tests[name](page, rest);
    expect(!page.faults.length, `the page says: ${page.faults.join("; ")}`);
} finally {
    await browser.close();
}
