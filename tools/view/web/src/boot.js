// While the page loads: its theme, and how much of it is there.  Runs before the data are read.
const root = document.documentElement;
root.dataset.theme = matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light";
const timer = setInterval(() => {
    const blocks = document.querySelectorAll("script[data-share]");
    const share = Number(blocks[blocks.length - 1]?.dataset.share ?? 0);
    if (document.readyState !== "loading") return clearInterval(timer);
    document.getElementById("progress").hidden = false;
    document.getElementById("progress-bar").firstChild.style.width = `${100 * share}%`;
    document.getElementById("progress-bar").setAttribute("aria-valuenow", Math.round(100 * share));
    document.getElementById("progress-text").textContent = `loading ${Math.round(100 * share)} %`;
}, 60);
