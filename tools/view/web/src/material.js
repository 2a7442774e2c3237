// How the surface is drawn: one material for all shadings and colour modes.
import { DataTexture, DoubleSide, LinearFilter, RGBAFormat, ShaderMaterial } from "three";
import { mapBytes } from "./colours.js";

const VERTEX = `
attribute vec3 rest;
attribute vec3 tint;
attribute vec2 share;
varying vec3 vView, vNormal, vWorldNormal, vRest, vTint;
varying vec2 vShare;
uniform float uPull;
void main() {
    vec4 at = modelViewMatrix * vec4(position, 1.0);
    vView = at.xyz;
    vNormal = normalMatrix * normal;
    vWorldNormal = normal;
    vRest = rest;
    vTint = tint;
    vShare = share;
    gl_Position = projectionMatrix * at;
    gl_Position.z -= uPull * gl_Position.w;
}`;

const FRAGMENT = `
uniform int uMode;
uniform bool uFlat, uLines;
uniform float uCells, uOpacity;
uniform vec3 uSpan;
uniform vec3 uPlain;
uniform sampler2D uMap;
varying vec3 vView, vNormal, vWorldNormal, vRest, vTint;
varying vec2 vShare;

vec3 checker() {
    vec3 cell = floor(vRest * uCells);
    float odd = mod(cell.x + cell.y + cell.z, 2.0);
    vec3 hue = 0.25 + 0.7 * clamp(vRest / uSpan, 0.0, 1.0);
    return mix(hue * 0.42, hue, odd);
}

void main() {
    vec3 normal = uFlat ? normalize(cross(dFdx(vView), dFdy(vView))) : normalize(vNormal);
    vec3 toEye = normalize(-vView);
    if (!uFlat && !gl_FrontFacing) normal = -normal;
    vec3 colour = uPlain;
    if (uMode == 1) colour = vTint;
    if (uMode == 2) colour = checker();
    if (uMode == 3) colour = 0.5 + 0.5 * normalize(vWorldNormal);
    if (uMode == 4) { // share is 0, 0 where nothing is known
        vec3 known = texture2D(uMap, vec2(clamp(vShare.x / max(vShare.y, 1e-4), 0.002, 0.998), 0.5)).rgb;
        colour = mix(vec3(0.5), known, vShare.y);
    }
    if (!gl_FrontFacing) colour *= 0.55;
    float key = max(dot(normal, normalize(vec3(0.35, 0.55, 0.75))), 0.0);
    float fill = 0.5 + 0.5 * dot(normal, normalize(vec3(-0.5, 0.2, 0.6)));
    float light = 0.34 + 0.52 * key + 0.22 * fill;
    vec3 halfway = normalize(toEye + normalize(vec3(0.35, 0.55, 0.75)));
    float gloss = uMode == 0 ? 0.10 * pow(max(dot(normal, halfway), 0.0), 28.0) : 0.0;
    if (uMode == 3) light = 1.0;
    if (uMode == 4 || uMode == 2 || uMode == 1) light = mix(1.0, light, 0.72);
    gl_FragColor = vec4(uLines ? colour : colour * light + gloss, uOpacity);
}`;

function texture(name) {
    const map = new DataTexture(mapBytes(name), 256, 1, RGBAFormat);
    map.minFilter = map.magFilter = LinearFilter;
    map.needsUpdate = true;
    return map;
}

const maps = {};
export const mapTexture = (name) => (maps[name] ??= texture(name));

export function surfaceMaterial() {
    return new ShaderMaterial({
        vertexShader: VERTEX,
        fragmentShader: FRAGMENT,
        side: DoubleSide,
        uniforms: {
            uMode: { value: 0 },
            uFlat: { value: false },
            uLines: { value: false },
            uPull: { value: 0 },
            uOpacity: { value: 1 },
            uCells: { value: 12 },
            uSpan: { value: [1, 1, 1] }, // of the reference's sides, in its longest
            uPlain: { value: [0.72, 0.74, 0.78] },
            uMap: { value: mapTexture("diverging") },
        },
    });
}
