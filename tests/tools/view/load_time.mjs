// How long pages take: processor seconds of the whole browser until the first picture, and per picture while playing.
// Wall time says little on a machine that draws in software and has other work.
//
//     node load_time.mjs MODULES BROWSER PAGE...      MODULES: as in view_page.bats
import fs from "node:fs";
import path from "node:path";
import { pathToFileURL } from "node:url";
import { openBrowser, openPage, ready } from "./open_browser.mjs";

const [modules, program, ...pages] = process.argv.slice(2);

/** Processor seconds of this process's children and theirs. */
function processorSeconds() {
    const all = fs.readdirSync("/proc").filter((name) => /^\d+$/.test(name));
    const rows = all.flatMap((pid) => {
        try {
            const fields = fs.readFileSync(`/proc/${pid}/stat`, "utf8").split(") ").at(-1).split(" ");
            return [{ pid, parent: fields[1], ticks: Number(fields[11]) + Number(fields[12]) }];
        } catch {
            return []; // it has ended
        }
    });
    const ours = new Set([`${process.pid}`]);
    for (let before = 0; before !== ours.size; ) {
        before = ours.size;
        for (const row of rows) if (ours.has(row.parent)) ours.add(row.pid);
    }
    ours.delete(`${process.pid}`);
    return rows.filter((row) => ours.has(row.pid)).reduce((sum, row) => sum + row.ticks, 0) / 100;
}

const browser = await openBrowser(modules, program);
const first = await openPage(browser, pathToFileURL(path.resolve(pages[0])).href); // the browser's own start
await ready(first);
await first.close();
for (const name of pages) {
    const begun = processorSeconds();
    const page = await openPage(browser, pathToFileURL(path.resolve(name)).href, { width: 1280, height: 800 });
    await ready(page);
    const loaded = processorSeconds();
    const wall = await page.evaluate(() => document.body.dataset.ready);
    const pictures = await page.evaluate(async () => {
        const before = window.neupig.pictures;
        window.neupig.play(true);
        await new Promise((resolve) => setTimeout(resolve, 5000));
        window.neupig.play(false);
        return window.neupig.pictures - before;
    });
    const each = (processorSeconds() - loaded) / Math.max(1, pictures);
    console.log(
        `${name}: first picture after ${(loaded - begun).toFixed(2)} processor s (${wall} ms), ` +
            `each picture ${(1000 * each).toFixed(0)} processor ms, ${(pictures / 5).toFixed(1)} a second`,
    );
    await page.close();
}
await browser.close();
