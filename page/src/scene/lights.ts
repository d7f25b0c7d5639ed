import { Matrix3, Matrix4, Vector3, Vector4, type Camera, type Object3D } from "three";
import type { LightEntry, PackHeader, Vector } from "./pack.ts";

/** More lights cost time for each pixel. */
const MAX_LIGHTS = 16;

/** MuJoCo's ambient light if a model has neither lights nor a headlight. */
const DEFAULT_AMBIENT = 0.3;

/** The uniforms of `Shading`. */
export interface LightUniforms {
  readonly count: number;
  readonly uniforms: Record<string, { value: unknown }>;
}

/** The lights of a model, with the headlight first if it is on. Each world is lit only by its own lights. */
export class Lights implements LightUniforms {
  readonly count: number;
  readonly uniforms: Record<string, { value: unknown }>;
  /** The lights without the headlight. */
  readonly entries: readonly LightEntry[];
  readonly #headlight: boolean;
  readonly #positions: Vector4[];
  readonly #directions: Vector4[];
  readonly #shadows: number[];

  constructor({ vis, lights }: PackHeader) {
    this.#headlight = vis.headlight.active !== 0;
    const first = this.#headlight ? 1 : 0;
    // MuJoCo's renderer ignores point and image lights.
    const supported = lights.filter(({ type, active }) => active && (type === "directional" || type === "spot"));
    this.entries = supported.slice(0, MAX_LIGHTS - first);
    this.count = first + this.entries.length;
    const shown = this.#headlight ? [vis.headlight, ...this.entries] : this.entries;
    this.#positions = shown.map(() => new Vector4(0, 0, 0, 0));
    this.#directions = shown.map(() => new Vector4(0, 0, -1, -1));
    this.#shadows = shown.map(() => -1);
    this.entries.forEach(({ type, cutoff }, index) => {
      this.#positions[first + index]!.w = type === "directional" ? 0 : 1;
      this.#directions[first + index]!.w = cutoff >= 180 ? -1 : Math.cos((cutoff * Math.PI) / 180);
    });
    const shapes = shown.map((entry) =>
      "attenuation" in entry ? shapeOf(entry as LightEntry) : new Vector4(1, 0, 0, 0),
    );
    const ambient = this.count > 0 ? 0 : DEFAULT_AMBIENT;
    this.uniforms = {
      mjGlobalAmbient: { value: new Vector3(ambient, ambient, ambient) },
      mjLightPosition: { value: this.#positions },
      mjLightDirection: { value: this.#directions },
      mjLightShape: { value: shapes },
      mjLightAmbient: { value: shown.map((entry) => color(entry.ambient)) },
      mjLightDiffuse: { value: shown.map((entry) => color(entry.diffuse)) },
      mjLightSpecular: { value: shown.map((entry) => color(entry.specular)) },
      mjLightShadow: { value: this.#shadows },
    };
  }

  /** Sets the number of the shadow map of a light, or -1. */
  setShadow(entry: LightEntry, slot: number): void {
    const index = this.entries.indexOf(entry);
    if (index >= 0) this.#shadows[index + (this.#headlight ? 1 : 0)] = slot;
  }

  /** Moves the lights with their bodies; call it before the scene is drawn with a camera. */
  update(bodies: readonly Object3D[], root: Object3D, camera: Camera): void {
    const first = this.#headlight ? 1 : 0;
    const rotation = new Matrix3().setFromMatrix4(camera.matrixWorldInverse);
    if (this.#headlight) this.#directions[0]!.set(0, 0, -1, -1);
    const position = new Vector3();
    const direction = new Vector3();
    this.entries.forEach((entry, index) => {
      lightPose(entry, bodies, root.matrixWorld, position, direction);
      position.applyMatrix4(camera.matrixWorldInverse);
      direction.applyMatrix3(rotation);
      const target = this.#positions[first + index]!;
      target.set(position.x, position.y, position.z, target.w);
      const directed = this.#directions[first + index]!;
      directed.set(direction.x, direction.y, direction.z, directed.w);
    });
  }
}

const scratch = new Vector3();
const rotation = new Matrix4();

/** Computes position and direction of a light in the scene, as MuJoCo does for each mode. */
export function lightPose(
  entry: LightEntry,
  bodies: readonly Object3D[],
  root: Matrix4,
  position: Vector3,
  direction: Vector3,
): void {
  const body = bodies[entry.body]!;
  const mode = entry.mode ?? "fixed";
  if ((mode === "track" || mode === "trackcom") && entry.pos0 !== undefined && entry.dir0 !== undefined) {
    rotation.extractRotation(root);
    position.setFromMatrixPosition(body.matrixWorld).add(scratch.fromArray(entry.pos0).applyMatrix4(rotation));
    direction.fromArray(entry.dir0).applyMatrix4(rotation);
  } else {
    position.fromArray(entry.pos).applyMatrix4(body.matrixWorld);
    direction.fromArray(entry.dir).transformDirection(body.matrixWorld);
  }
  const target = mode.startsWith("target") ? bodies[entry.target ?? -1] : undefined;
  if (target !== undefined) direction.setFromMatrixPosition(target.matrixWorld).sub(position);
  direction.normalize();
}

function shapeOf({ type, attenuation, cutoff, exponent }: LightEntry): Vector4 {
  const [constant = 1, linear = 0, quadratic = 0] = type === "spot" ? attenuation : [1, 0, 0];
  return new Vector4(constant, linear, quadratic, type === "spot" && cutoff < 180 ? exponent : 0);
}

function color([red = 0, green = 0, blue = 0]: Vector): Vector3 {
  return new Vector3(red, green, blue);
}
