// The picture: one or two views of the same space, seen by one camera.
import {
    AxesHelper,
    CanvasTexture,
    Color,
    ColorManagement,
    GridHelper,
    LinearSRGBColorSpace,
    OrthographicCamera,
    PerspectiveCamera,
    Ray,
    Scene,
    Sprite,
    SpriteMaterial,
    Vector2,
    Vector3,
    WebGLRenderer,
} from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import { boundsOf, Figure } from "./figure.js";

ColorManagement.enabled = false; // all colours are those of the screen

const SLOW_MS = 45; // between pictures
const OPENING = 30; // degrees, of the shorter side
const VIEWS = { front: [0, 0], right: [90, 0], back: [180, 0], left: [-90, 0], top: [0, 90] }; // azimuth, elevation

/** Whether the browser draws in software: asked of a context of its own, as edges are chosen with a context. */
function isSoftware() {
    const context = document.createElement("canvas").getContext("webgl2");
    if (!context) throw new Error("the browser has no WebGL 2");
    const names = context.getExtension("WEBGL_debug_renderer_info");
    const name = context.getParameter(names ? names.UNMASKED_RENDERER_WEBGL : context.RENDERER);
    context.getExtension("WEBGL_lose_context")?.loseContext();
    return /swiftshader|llvmpipe|software|basic render/i.test(name);
}

const AXES = [
    ["X", 0xd9424a],
    ["Y", 0x3c9a4f],
    ["Z", 0x3e63dd],
];

function letter(text, colour) {
    const canvas = document.createElement("canvas");
    canvas.width = canvas.height = 64;
    const c = canvas.getContext("2d");
    c.font = "bold 52px system-ui, sans-serif";
    c.textAlign = "center";
    c.textBaseline = "middle";
    c.fillStyle = `#${new Color(colour).getHexString()}`;
    c.fillText(text, 32, 34);
    return new Sprite(new SpriteMaterial({ map: new CanvasTexture(canvas), depthTest: false }));
}

/** The capture's axes, for a corner of the picture. */
class Gizmo {
    constructor() {
        this.scene = new Scene();
        this.camera = new OrthographicCamera(-1.6, 1.6, 1.6, -1.6, 0.1, 20);
        this.scene.add(new AxesHelper(1).setColors(...AXES.map(([, colour]) => colour)));
        AXES.forEach(([text, colour], a) => {
            const name = letter(text, colour);
            name.position.setComponent(a, 1.3);
            name.scale.setScalar(0.6);
            this.scene.add(name);
        });
    }

    draw(renderer, camera, [left, bottom, side]) {
        renderer.setViewport(left, bottom, side, side);
        renderer.setScissor(left, bottom, side, side);
        renderer.clearDepth();
        this.camera.up.copy(camera.up);
        this.camera.quaternion.copy(camera.quaternion);
        this.camera.position.set(0, 0, 6).applyQuaternion(camera.quaternion);
        renderer.render(this.scene, this.camera);
    }
}

export class Stage {
    constructor(canvas, count, up, onChange) {
        this.canvas = canvas;
        canvas.width = canvas.clientWidth;
        canvas.height = canvas.clientHeight;
        // In software smooth edges would take most of the time.
        this.renderer = new WebGLRenderer({
            canvas,
            antialias: !isSoftware(),
            powerPreference: "high-performance",
        });
        this.renderer.outputColorSpace = LinearSRGBColorSpace;
        this.renderer.autoClear = false;
        this.camera = new PerspectiveCamera(OPENING, 1, 0.01, 100);
        this.isZUp = up.endsWith("z");
        this.sign = up.startsWith("-") ? -1 : 1; // cameras have up in minus y
        this.share = 1; // of the pixels' density, while something moves
        this.camera.up.set(0, this.isZUp ? 0 : this.sign, this.isZUp ? this.sign : 0);
        this.controls = new OrbitControls(this.camera, canvas);
        this.controls.enableDamping = false;
        this.controls.addEventListener("change", onChange);
        this.controls.addEventListener("start", () => (this.isTurning = true));
        this.controls.addEventListener("end", () => (this.isTurning = false));
        this.gizmo = new Gizmo();
        this.panes = Array.from({ length: count }, () => {
            const pane = { scene: new Scene(), figure: new Figure(), grid: null };
            pane.scene.add(pane.figure.group);
            return pane;
        });
    }

    get figures() {
        return this.panes.map((pane) => pane.figure);
    }

    /** Colours of the theme. */
    setGround(ground, line) {
        this.ground = new Color(ground);
        this.line = new Color(line);
        this.placeGrid();
    }

    placeGrid(bounds = this.gridBounds) {
        if (!bounds) return;
        this.gridBounds = bounds;
        const side = Math.max(...bounds.high.map((x, a) => x - bounds.low[a])) || 1;
        for (const pane of this.panes) {
            if (pane.grid) pane.scene.remove(pane.grid);
            pane.grid = new GridHelper(2 * side, 16, this.line, this.line);
            const middle = bounds.low.map((x, a) => (x + bounds.high[a]) / 2);
            const floor = this.sign > 0 ? bounds.low : bounds.high;
            if (this.isZUp) {
                pane.grid.rotateX(Math.PI / 2);
                pane.grid.position.set(middle[0], middle[1], floor[2]);
            } else {
                pane.grid.position.set(middle[0], floor[1], middle[2]);
            }
            pane.grid.visible = this.hasGrid ?? true;
            pane.scene.add(pane.grid);
        }
    }

    setGrid(isShown) {
        this.hasGrid = isShown;
        for (const pane of this.panes) if (pane.grid) pane.grid.visible = isShown;
    }

    /** Where the panes lie: beside each other, or one above the other where the picture is upright. */
    layout() {
        const { clientWidth: width, clientHeight: height } = this.canvas;
        if (this.panes.length === 1) return [[0, 0, width, height]];
        if (width >= height)
            return [
                [0, 0, width / 2, height],
                [width / 2, 0, width / 2, height],
            ];
        return [
            [0, 0, width, height / 2],
            [0, height / 2, width, height / 2],
        ]; // from the top
    }

    /** While something moves, fewer pixels where pictures take long; all of them once it rests. */
    setMoving(isMoving) {
        if (this.isMoving === isMoving) return;
        this.isMoving = isMoving;
        this.slow = 0;
        this.resize();
    }

    /** How long the last picture took, while something moves. */
    noteTime(milliseconds) {
        if (!this.isMoving || milliseconds > 2000) return;
        this.slow = milliseconds > SLOW_MS ? (this.slow ?? 0) + 1 : 0;
        if (this.slow < 4 || this.share <= 0.4) return;
        this.share *= 0.7;
        this.slow = 0;
        this.resize();
    }

    /** To the size that the page gives it; another buffer is dear where there is no GPU. */
    resize() {
        const { clientWidth: width, clientHeight: height } = this.canvas;
        const ratio = Math.min(window.devicePixelRatio, 2) * (this.isMoving ? this.share : 1);
        const size = `${width} ${height} ${ratio}`;
        if (size === this.size) return;
        this.size = size;
        this.renderer.setDrawingBufferSize(Math.max(width, 1), Math.max(height, 1), ratio);
    }

    #aim(aspect) {
        this.camera.aspect = aspect;
        const half = Math.tan((OPENING * Math.PI) / 360);
        this.camera.fov = aspect < 1 ? (Math.atan(half / aspect) * 360) / Math.PI : OPENING;
        this.camera.updateProjectionMatrix();
    }

    draw() {
        const { renderer } = this;
        const height = this.canvas.clientHeight;
        renderer.setScissorTest(true);
        this.layout().forEach(([left, top, w, h], i) => {
            renderer.setViewport(left, height - top - h, w, h);
            renderer.setScissor(left, height - top - h, w, h);
            renderer.setClearColor(this.ground);
            renderer.clear();
            this.#aim(w / Math.max(h, 1));
            renderer.render(this.panes[i].scene, this.camera);
            const side = Math.min(84, w / 4, h / 4);
            this.gizmo.draw(renderer, this.camera, [left + w - side - 6, height - top - h + 6, side]);
        });
    }

    /** Bounds of what is shown. */
    bounds() {
        const all = this.figures
            .filter((figure) => figure.frame)
            .map((figure) => boundsOf(figure.frame.positions));
        if (!all.length) return null;
        const pick = (side, choose) => [0, 1, 2].map((a) => choose(...all.map((b) => b[side][a])));
        return { low: pick("low", Math.min), high: pick("high", Math.max) };
    }

    /** Look from one of the fixed sides, or from where the camera is (null), at all of what is shown. */
    fit(view, margin = 0.97) {
        const bounds = this.bounds();
        if (!bounds) return;
        const low = new Vector3(...bounds.low),
            high = new Vector3(...bounds.high);
        const middle = low.clone().add(high).multiplyScalar(0.5);
        const radius = Math.max(low.distanceTo(high) / 2, 1e-9) * margin;
        const distance = radius / Math.sin((OPENING * Math.PI) / 360);
        const away = view
            ? this.#direction(...(VIEWS[view] ?? view))
            : this.camera.position.clone().sub(this.controls.target).normalize();
        this.controls.target.copy(middle);
        this.camera.position.copy(middle).addScaledVector(away, distance);
        this.camera.near = distance / 1000;
        this.camera.far = distance * 40;
        this.controls.update();
        this.#aim(this.camera.aspect);
    }

    /** Look from where the camera was, {camera, target}. */
    lookFrom(place) {
        this.camera.position.fromArray(place.camera);
        this.controls.target.fromArray(place.target);
        this.controls.update();
    }

    #direction(azimuth, elevation) {
        const [a, e] = [azimuth, Math.min(elevation, 89.9)].map((degrees) => (degrees * Math.PI) / 180);
        const [side, ahead, above] = [Math.sin(a) * Math.cos(e), Math.cos(a) * Math.cos(e), Math.sin(e)];
        const [front, top] = [this.sign * ahead, this.sign * above];
        return this.isZUp ? new Vector3(side, -front, top) : new Vector3(side, top, front);
    }

    /** What is at a place of the canvas: {result, vertex, corners, weights}, or null. */
    pick(x, y) {
        const panes = this.layout();
        const i = panes.findIndex(
            ([left, top, w, h]) => x >= left && x < left + w && y >= top && y < top + h,
        );
        if (i < 0) return null;
        const [left, top, w, h] = panes[i];
        this.#aim(w / Math.max(h, 1));
        this.camera.updateMatrixWorld();
        const at = new Vector2(((x - left) / w) * 2 - 1, 1 - ((y - top) / h) * 2);
        const origin = this.camera.position.clone();
        const direction = new Vector3(at.x, at.y, 0.5).unproject(this.camera).sub(origin).normalize();
        const hit = this.figures[i].pick(new Ray(origin, direction));
        return hit ? { result: i, ...hit } : null;
    }
}
