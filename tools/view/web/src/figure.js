// One result in the scene: its surface, its points, and what was picked on it.
import {
    BufferAttribute,
    BufferGeometry,
    Color,
    Group,
    Line,
    LineBasicMaterial,
    LineSegments,
    Mesh,
    Points,
    PointsMaterial,
    Raycaster,
    Sphere,
    Triangle,
    Vector3,
} from "three";
import { edgesOf, fillShares, modeOf } from "./colours.js";
import { mapTexture, surfaceMaterial } from "./material.js";

/** Unit normals of vertices from the faces around them, weighted by their areas. */
function fillNormals(out, positions, faces) {
    out.fill(0);
    for (let f = 0; f < faces.length; f += 3) {
        const [a, b, c] = [3 * faces[f], 3 * faces[f + 1], 3 * faces[f + 2]];
        const ux = positions[b] - positions[a],
            uy = positions[b + 1] - positions[a + 1],
            uz = positions[b + 2] - positions[a + 2];
        const vx = positions[c] - positions[a],
            vy = positions[c + 1] - positions[a + 1],
            vz = positions[c + 2] - positions[a + 2];
        const nx = uy * vz - uz * vy,
            ny = uz * vx - ux * vz,
            nz = ux * vy - uy * vx;
        out[a] += nx;
        out[a + 1] += ny;
        out[a + 2] += nz;
        out[b] += nx;
        out[b + 1] += ny;
        out[b + 2] += nz;
        out[c] += nx;
        out[c + 1] += ny;
        out[c + 2] += nz;
    }
    for (let i = 0; i < out.length; i += 3) {
        const length = Math.hypot(out[i], out[i + 1], out[i + 2]) || 1;
        out[i] /= length;
        out[i + 1] /= length;
        out[i + 2] /= length;
    }
}

/** Low and high corner of positions. */
export function boundsOf(positions) {
    const low = [Infinity, Infinity, Infinity],
        high = [-Infinity, -Infinity, -Infinity];
    for (let i = 0; i < positions.length; i++) {
        const a = i % 3;
        if (positions[i] < low[a]) low[a] = positions[i];
        if (positions[i] > high[a]) high[a] = positions[i];
    }
    return { low, high };
}

const everywhere = new Sphere(new Vector3(), Infinity);

export class Figure {
    constructor() {
        this.group = new Group();
        this.surface = this.lines = null;
        this.store = this.frame = null;
        this.material = surfaceMaterial();
        this.cover = surfaceMaterial(); // under lines: hides what lies behind
        this.cover.polygonOffset = true;
        this.cover.polygonOffsetFactor = this.cover.polygonOffsetUnits = 1;
        this.lineMaterial = surfaceMaterial();
        this.lineMaterial.uniforms.uLines.value = true;
        this.depth = surfaceMaterial(); // before a surface that is seen through: only its front is drawn
        this.depth.colorWrite = false;
        this.points = this.#cloud(0xff9d2e, 2.6);
        this.dropped = this.#cloud(0xd0219b, 4);
        this.ends = this.#cloud(0x1aa6b7, 9); // what was measured between
        this.ends.material.depthTest = false;
        this.ruler = new Line(
            new BufferGeometry(),
            new LineBasicMaterial({ color: 0x1aa6b7, depthTest: false, transparent: true }),
        );
        this.mark = this.#cloud(0xff2e88, 11);
        this.mark.material.depthTest = false;
        this.path = new Line(
            new BufferGeometry(),
            new LineBasicMaterial({ color: 0xff2e88, depthTest: false, transparent: true }),
        );
        for (const above of [this.mark, this.path, this.ends, this.ruler]) above.renderOrder = 4;
        this.path.frustumCulled = this.ruler.frustumCulled = false;
        this.path.visible = this.ruler.visible = false;
        this.group.add(this.points, this.dropped, this.path, this.mark, this.ruler, this.ends);
    }

    #cloud(colour, size) {
        const cloud = new Points(
            new BufferGeometry(),
            new PointsMaterial({ color: colour, size, sizeAttenuation: false }),
        );
        cloud.frustumCulled = false;
        cloud.visible = false;
        return cloud;
    }

    /** Geometry for another part: other vertices and faces. */
    #take(store) {
        const { part } = store;
        const v = part.vertices;
        const geometry = new BufferGeometry();
        const dynamic = (array, size) => new BufferAttribute(array, size).setUsage(35048);
        geometry.setIndex(new BufferAttribute(part.faces, 1));
        geometry.setAttribute("position", dynamic(new Float32Array(3 * v), 3));
        geometry.setAttribute("normal", dynamic(new Float32Array(3 * v), 3));
        geometry.setAttribute("share", dynamic(new Float32Array(2 * v), 2));
        const { low, high } = boundsOf(part.rest);
        const longest = Math.max(...high.map((x, a) => x - low[a])) || 1;
        const span = high.map((x, a) => Math.max((x - low[a]) / longest, 1e-6));
        const shares = Float32Array.from(part.rest, (x, i) => (x - low[i % 3]) / longest); // what the checker is cut from
        for (const material of [this.material, this.lineMaterial]) material.uniforms.uSpan.value = span;
        geometry.setAttribute("rest", new BufferAttribute(shares, 3));
        geometry.setAttribute(
            "tint",
            new BufferAttribute(part.colours ?? new Uint8Array(3 * v).fill(180), 3, true),
        );
        geometry.boundingSphere = everywhere;
        part.edges ??= edgesOf(part);
        const wires = new BufferGeometry();
        for (const name of ["position", "normal", "share", "rest", "tint"])
            wires.setAttribute(name, geometry.getAttribute(name));
        wires.setIndex(new BufferAttribute(part.edges.ends, 1));
        wires.boundingSphere = everywhere;
        this.#drop();
        this.surface = new Mesh(geometry, this.material);
        this.lines = new LineSegments(wires, this.lineMaterial);
        this.front = new Mesh(geometry, this.depth);
        for (const object of [this.surface, this.lines, this.front]) object.frustumCulled = false;
        this.front.renderOrder = 1;
        this.surface.renderOrder = this.lines.renderOrder = 2;
        this.group.add(this.surface, this.lines, this.front);
        this.store = store;
    }

    #drop() {
        for (const object of [this.surface, this.lines, this.front]) {
            if (!object) continue;
            this.group.remove(object);
            object.geometry.dispose();
        }
    }

    /** Show a frame of a store, or nothing (null). */
    show(store, frame, hasMesh) {
        if (store && frame && this.store !== store) this.#take(store);
        this.frame = frame;
        this.hasMesh = Boolean(frame && hasMesh);
        if (!frame || !this.surface) return;
        const geometry = this.surface.geometry;
        const position = geometry.getAttribute("position"),
            normal = geometry.getAttribute("normal");
        position.array.set(frame.positions);
        fillNormals(normal.array, frame.positions, store.part.faces);
        position.needsUpdate = normal.needsUpdate = true;
        this.#place(this.points, frame.points);
        this.#place(this.dropped, frame.dropped);
    }

    #place(object, positions) {
        object.geometry.dispose();
        object.geometry = new BufferGeometry();
        object.geometry.setAttribute("position", new BufferAttribute(positions, 3));
        object.geometry.boundingSphere = everywhere;
    }

    /** How much the surface hides, 0 to 1; what lies behind its front is seen through that alone. */
    #setOpacity(opacity) {
        const isClear = opacity < 1;
        for (const material of [this.material, this.cover, this.lineMaterial]) {
            material.uniforms.uOpacity.value = opacity;
            if (material.transparent !== isClear) material.needsUpdate = true;
            material.transparent = isClear;
        }
        this.depth.transparent = isClear; // after the points, which are not
        if (this.front) this.front.visible = this.hasMesh && isClear && opacity > 0;
        return opacity > 0;
    }

    /** look: {shading, colour, range, points, opacity, plain} */
    dress(look) {
        const mode = modeOf(look.colour),
            isWire = look.shading === "wire";
        if (this.frame && this.surface && mode.map) {
            const share = this.surface.geometry.getAttribute("share");
            fillShares(share.array, look.colour, this.frame, this.store, look.range);
            share.needsUpdate = true;
        }
        for (const material of [this.material, this.lineMaterial]) {
            material.uniforms.uMode.value = mode.shader;
            material.uniforms.uFlat.value = look.shading === "flat";
            material.uniforms.uPlain.value = new Color(look.plain).toArray();
            if (mode.map) material.uniforms.uMap.value = mapTexture(mode.map);
        }
        this.cover.uniforms.uMode.value = 0;
        this.cover.uniforms.uLines.value = true;
        this.cover.uniforms.uPlain.value = new Color(look.ground).toArray();
        const isSeen = this.#setOpacity(look.opacity) && this.hasMesh;
        if (this.surface) {
            this.surface.visible = isSeen;
            this.surface.material = isWire ? this.cover : this.material;
            this.lines.visible = isSeen && isWire;
        }
        this.points.visible = look.points && Boolean(this.frame?.points.length);
        this.dropped.visible = look.points && Boolean(this.frame?.dropped.length);
        this.points.material.color.set(look.pointColour);
    }

    /** Where a ray meets the surface: {vertex, corners, weights}, or null. */
    pick(ray) {
        if (!this.surface?.visible) return null;
        const caster = new Raycaster(ray.origin, ray.direction);
        const hit = caster.intersectObject(this.surface, false)[0];
        if (!hit) return null;
        const p = this.frame.positions;
        const far = (i) => hit.point.distanceToSquared(new Vector3(p[3 * i], p[3 * i + 1], p[3 * i + 2]));
        const { a, b, c } = hit.face;
        return {
            vertex: [a, b, c].reduce((best, i) => (far(i) < far(best) ? i : best)),
            corners: [a, b, c],
            weights: Triangle.getBarycoord(
                hit.point,
                ...[a, b, c].map((i) => new Vector3(...p.subarray(3 * i, 3 * i + 3))),
                new Vector3(),
            ).toArray(),
        };
    }

    /** The place of a hit in the frame that is shown. */
    placeOf({ corners, weights }) {
        const p = this.frame.positions;
        return [0, 1, 2].map((a) => corners.reduce((sum, i, k) => sum + weights[k] * p[3 * i + a], 0));
    }

    /** Marks where was measured, none, one or two, and the line between two. */
    setRuler(hits) {
        const isShown = Boolean(this.frame && this.hasMesh && hits.length);
        this.ends.visible = isShown;
        this.ruler.visible = isShown && hits.length === 2;
        if (!isShown) return null;
        const places = hits.map((hit) => this.placeOf(hit));
        this.#place(this.ends, Float32Array.from(places.flat()));
        if (places.length < 2) return null;
        this.#place(this.ruler, Float32Array.from(places.flat()));
        return Math.hypot(...places[0].map((x, a) => x - places[1][a]));
    }

    /** Mark a vertex with its way through all frames; null: none. */
    setPick(vertex, way) {
        this.picked = vertex;
        this.path.visible = vertex !== null && Boolean(way);
        if (way) this.#place(this.path, way);
        this.moveMark();
    }

    moveMark() {
        const i = this.picked;
        this.mark.visible = i !== null && i !== undefined && Boolean(this.frame && this.hasMesh);
        if (this.mark.visible) this.#place(this.mark, this.frame.positions.slice(3 * i, 3 * i + 3));
    }
}
