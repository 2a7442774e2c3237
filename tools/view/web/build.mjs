// Bundle the page: scripts, style and skeleton into one HTML file, which neupig view fills with data.
//
//     node build.mjs PAGE.html
//
// The page's policy allows these two scripts, by their checksums, and nothing from elsewhere: text that comes with a
// result can't be executed, whatever it is called.
import { createHash } from "node:crypto";
import { readFile, writeFile } from "node:fs/promises";
import { build } from "esbuild";

const output = process.argv[2];
const folder = new URL("./src/", import.meta.url);
if (!output) throw new Error("node build.mjs PAGE.html");

async function bundle(entry, options) {
    const result = await build({
        entryPoints: [new URL(entry, folder).pathname],
        absWorkingDir: new URL(".", import.meta.url).pathname,
        bundle: true,
        minify: true,
        write: false,
        target: ["es2022"],
        charset: "ascii",
        legalComments: "inline",
        ...options,
    });
    return result.outputFiles[0].text.trim();
}

const script = (await bundle("main.js", { format: "iife" })).replaceAll("</script", "<\\/script");
const boot = (await bundle("boot.js", { format: "iife" })).replaceAll("</script", "<\\/script");
const style = await bundle("style.css", {});
const hash = (text) => `'sha256-${createHash("sha256").update(text).digest("base64")}'`;
const policy = [
    "default-src 'none'",
    `script-src ${hash(boot)} ${hash(script)}`,
    `style-src 'unsafe-inline'`,
    "img-src data: blob:",
    "base-uri 'none'",
    "form-action 'none'",
].join("; ");
const page = (await readFile(new URL("page.html", folder), "utf8"))
    .replace("<!--policy-->", () => `<meta http-equiv="Content-Security-Policy" content="${policy}">`)
    .replace("<!--style-->", () => `<style>${style}</style>`)
    .replace("<!--boot-->", () => `<script>${boot}</script>`)
    .replace("<!--script-->", () => `<script>${script}</script>`);
await writeFile(output, page);
