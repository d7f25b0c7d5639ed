import { BufferAttribute, BufferGeometry, type Color, Points, ShaderMaterial, Vector2 } from "three";
import type { Points as PointValues } from "../scan.ts";
import { unpickable } from "./display.ts";

/** What colours points: one colour, the height above the ground, a value of each point, or its own colour. */
export type Colouring = "one" | "height" | "value" | "rgb";

/** The colours follow Google's Turbo; this polynomial approximates it. */
const VERTEX = `
attribute float value;
attribute vec3 colour;
uniform float size;
uniform int colouring;
varying float vValue;
varying vec3 vColour;
void main() {
  vec4 world = modelMatrix * vec4(position, 1.0);
  vValue = colouring == 1 ? world.z : value;
  vColour = colour;
  vec4 seen = viewMatrix * world;
  // A little nearer to the camera, so that points on a surface are not hidden by it.
  seen.xyz *= 0.995;
  gl_Position = projectionMatrix * seen;
  gl_PointSize = size;
}`;
const FRAGMENT = `
uniform int colouring;
uniform vec3 one;
uniform vec2 range;
varying float vValue;
varying vec3 vColour;
vec3 turbo(float x) {
  vec4 v = vec4(1.0, x, x * x, x * x * x);
  vec2 w = v.zw * v.z;
  return vec3(
    dot(v, vec4(0.1357, 4.6154, -42.6603, 132.1311)) + dot(w, vec2(-152.9424, 59.2864)),
    dot(v, vec4(0.0914, 2.1942, 4.8430, -14.1850)) + dot(w, vec2(4.2773, 2.8296)),
    dot(v, vec4(0.1067, 12.6419, -60.5820, 110.3628)) + dot(w, vec2(-89.9031, 27.3482)));
}
void main() {
  vec2 at = gl_PointCoord - 0.5;
  if (dot(at, at) > 0.25) discard;
  vec3 shown = one;
  if (colouring == 3) shown = vColour;
  else if (colouring != 0) shown = turbo(clamp((vValue - range.x) / max(range.y - range.x, 1e-6), 0.0, 1.0));
  gl_FragColor = vec4(clamp(shown, 0.0, 1.0), 1.0);
}`;
const NUMBERS: Readonly<Record<Colouring, number>> = { one: 0, height: 1, value: 2, rgb: 3 };

/** A cloud of round points with a size in pixels. */
export class PointCloud {
  readonly object: Points<BufferGeometry, ShaderMaterial>;
  readonly #range = new Vector2(0, 1);

  constructor(colour: Color) {
    const uniforms = {
      size: { value: 4 },
      colouring: { value: 0 },
      one: { value: colour },
      range: { value: this.#range },
    };
    const material = new ShaderMaterial({ vertexShader: VERTEX, fragmentShader: FRAGMENT, uniforms });
    this.object = unpickable(new Points(new BufferGeometry(), material));
    this.object.frustumCulled = false;
    // Until the first message has its place.
    this.object.visible = false;
  }

  /** @param size - Diameter in CSS pixels. */
  style(colouring: Colouring, size: number): void {
    const { uniforms } = this.object.material;
    uniforms["colouring"]!.value = NUMBERS[colouring];
    uniforms["size"]!.value = size * Math.min(2, window.devicePixelRatio);
  }

  set({ positions, values, colours }: PointValues): void {
    const geometry = new BufferGeometry();
    geometry.setAttribute("position", new BufferAttribute(positions, 3));
    const count = positions.length / 3;
    geometry.setAttribute("value", new BufferAttribute(values ?? new Float32Array(count), 1));
    geometry.setAttribute("colour", new BufferAttribute(colours ?? new Uint8Array(3 * count), 3, true));
    this.object.geometry.dispose();
    this.object.geometry = geometry;
  }

  /** Fits the range of the colours to the points; for heights, their pose must be known. */
  fitRange(colouring: Colouring): void {
    const { geometry, matrixWorld } = this.object;
    this.object.updateWorldMatrix(true, false);
    const position = geometry.getAttribute("position") as BufferAttribute | undefined;
    const value = geometry.getAttribute("value") as BufferAttribute | undefined;
    if (position === undefined || value === undefined) return;
    const [, , a, , , , b, , , , c, , , , d] = matrixWorld.elements;
    let [low, high] = [Infinity, -Infinity];
    for (let index = 0; index < position.count; index += 1) {
      const shown =
        colouring === "value"
          ? value.getX(index)
          : a! * position.getX(index) + b! * position.getY(index) + c! * position.getZ(index) + d!;
      if (shown < low) low = shown;
      if (shown > high) high = shown;
    }
    if (low <= high) this.#range.set(low, Math.max(high, low + 1e-3));
  }

  dispose(): void {
    this.object.removeFromParent();
    this.object.geometry.dispose();
    this.object.material.dispose();
  }
}
