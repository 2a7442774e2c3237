// A browser without a display, drawing in software, and what the tests ask of a page in it.
import { createRequire } from "node:module";

const DRAWING = [
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-gpu-vsync",
];

/** modules: the folder whose node_modules has playwright-core; program: the browser. */
export async function openBrowser(modules, program) {
    const { chromium } = createRequire(`${modules}/`)("playwright-core");
    const args = [...DRAWING, ...(process.getuid() === 0 ? ["--no-sandbox"] : [])];
    return chromium.launch({ executablePath: program, args });
}

/** A page that remembers what went wrong in it. */
export async function openPage(browser, url, size = { width: 1000, height: 720 }, options = {}) {
    const page = await browser.newPage({ viewport: size, colorScheme: "light", ...options });
    page.faults = [];
    page.on(
        "console",
        (message) => ["error", "warning"].includes(message.type()) && page.faults.push(message.text()),
    );
    page.on("pageerror", (error) => page.faults.push(`${error}`));
    page.on("request", (request) => {
        if (!/^(file|data|blob):|^http:\/\/127\.0\.0\.1:/.test(request.url()))
            page.faults.push(`asks for ${request.url()}`);
    });
    await page.goto(url);
    return page;
}

export async function ready(page) {
    await page.waitForFunction(() => document.body.dataset.ready, null, { timeout: 60000 });
}

/** Until the slot is on the screen. */
export async function shows(page, slot) {
    await page.waitForFunction((k) => window.neupig.shown?.slot === k && !window.neupig.isDirty, slot, {
        timeout: 30000,
    });
}

/** The picture as it is drawn now: a data URL of a PNG. */
export function pictureOf(page) {
    return page.evaluate(() => {
        window.neupig.stage.draw();
        return document.getElementById("canvas").toDataURL("image/png");
    });
}

/** {mean, share}: mean difference of two pictures' channels, and the share of pixels that are off by more than 40. */
export function compare(page, one, other) {
    return page.evaluate(
        async ([a, b]) => {
            const load = async (url) => {
                const image = new Image();
                image.src = url;
                await image.decode();
                const canvas = document.createElement("canvas");
                [canvas.width, canvas.height] = [image.width, image.height];
                const context = canvas.getContext("2d");
                context.drawImage(image, 0, 0);
                return context.getImageData(0, 0, image.width, image.height);
            };
            const [x, y] = [await load(a), await load(b)];
            if (x.width !== y.width || x.height !== y.height) return { mean: 255, share: 1 };
            let sum = 0,
                off = 0;
            for (let i = 0; i < x.data.length; i += 4) {
                const differences = [0, 1, 2].map((c) => Math.abs(x.data[i + c] - y.data[i + c]));
                sum += differences.reduce((p, q) => p + q);
                off += Math.max(...differences) > 40;
            }
            return { mean: sum / (0.75 * x.data.length), share: (4 * off) / x.data.length };
        },
        [one, other],
    );
}
