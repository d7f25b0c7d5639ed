import { Box3, MathUtils, Matrix4, PerspectiveCamera, Vector3 } from "three";
import type { OrbitControls } from "three/addons/controls/OrbitControls.js";
import type { Part } from "./part.ts";
import type { World } from "./world.ts";

/** Space around what is fitted, as a factor of its radius. */
const MARGIN = 1.15;

/** A model camera through which the user looks. */
export interface Through {
  readonly world: World;
  readonly camera: number;
}

/** Where the user looks from: a free camera that may follow a body, or a camera of a model. */
export class Viewpoint {
  #followed: { readonly world: World; readonly body: number; readonly last: Vector3 } | null = null;
  #through: Through | null = null;

  constructor(
    readonly camera: PerspectiveCamera,
    readonly controls: OrbitControls,
  ) {}

  get followed(): { readonly world: World; readonly body: number } | null {
    return this.#followed;
  }

  get through(): Through | null {
    return this.#through;
  }

  /** Looks from where MuJoCo's free camera starts. */
  reset({ pack, root }: World): void {
    const { vis, stat } = pack.header;
    const azimuth = MathUtils.degToRad(vis.global.azimuth);
    const elevation = MathUtils.degToRad(vis.global.elevation);
    const forward = new Vector3(
      Math.cos(elevation) * Math.cos(azimuth),
      Math.cos(elevation) * Math.sin(azimuth),
      Math.sin(elevation),
    );
    const { target } = this.controls;
    target.fromArray(stat.center as number[]).add(root.position);
    this.camera.position.copy(target).addScaledVector(forward, -1.5 * stat.extent);
    this.#lens(vis.global.fovy, vis.map.znear * stat.extent, vis.map.zfar * stat.extent);
    this.controls.minDistance = vis.map.znear * stat.extent;
    this.controls.maxDistance = 0.5 * vis.map.zfar * stat.extent;
    this.controls.update();
  }

  /** Moves the camera so that bodies are in the picture; the direction stays. */
  fit(world: World, bodies?: readonly number[]): void {
    const box = boundsOf(world, bodies);
    if (box.isEmpty()) return;
    const center = box.getCenter(new Vector3());
    const radius = Math.max(1e-3, box.getSize(new Vector3()).length() / 2);
    const half = MathUtils.degToRad(this.camera.fov / 2);
    const narrow = Math.atan(Math.tan(half) * Math.min(1, this.camera.aspect));
    const distance = (MARGIN * radius) / Math.sin(narrow);
    const direction = this.camera.position.clone().sub(this.controls.target).normalize();
    // What is fitted may be larger than the model says.
    const reach = 2 * (distance + radius);
    if (reach > this.camera.far) this.#lens(this.camera.fov, this.camera.near, reach);
    this.controls.maxDistance = Math.max(this.controls.maxDistance, reach);
    this.controls.target.copy(center);
    this.camera.position.copy(center).addScaledVector(direction, Math.max(distance, this.controls.minDistance));
    this.controls.update();
    if (this.#followed !== null) this.follow(this.#followed.world, this.#followed.body);
  }

  /** Moves the camera with a body; null ends it. */
  follow(world: World, body: number | null): void {
    this.#followed = body === null ? null : { world, body, last: world.bodyPoint(body) };
  }

  /** Looks through a camera of a model; null returns to the free camera. */
  lookThrough(world: World, camera: number | null): void {
    const saved = this.#saved;
    if (camera === null) {
      this.#through = null;
      this.controls.enabled = true;
      if (saved !== null) {
        this.camera.position.copy(saved.position);
        this.controls.target.copy(saved.target);
        this.#lens(saved.fov, this.camera.near, this.camera.far);
        this.#saved = null;
        this.controls.update();
      }
      return;
    }
    if (saved === null) {
      const { position, fov } = this.camera;
      this.#saved = { position: position.clone(), target: this.controls.target.clone(), fov };
    }
    this.controls.enabled = false;
    this.#through = { world, camera };
  }

  #saved: { readonly position: Vector3; readonly target: Vector3; readonly fov: number } | null = null;

  /** Forgets a world that leaves the scene. */
  forget(world: World): void {
    if (this.#followed?.world === world) this.#followed = null;
    if (this.#through?.world === world) this.lookThrough(world, null);
  }

  /** Moves the camera with what it follows; call it after the bodies have moved. */
  update(): void {
    if (this.#through !== null) {
      this.#look(this.#through);
    } else if (this.#followed !== null) {
      const { world, body, last } = this.#followed;
      const now = world.bodyPoint(body);
      const step = now.clone().sub(last);
      last.copy(now);
      if (step.lengthSq() > 0) {
        this.camera.position.add(step);
        this.controls.target.add(step);
        this.camera.updateMatrixWorld();
      }
    }
  }

  #look({ world, camera }: Through): void {
    const values = world.motion.cameras.subarray(12 * camera, 12 * camera + 12);
    const entry = world.pack.header.cameras[camera];
    if (values.length < 12 || entry === undefined) return;
    const [, , , a, b, c, d, e, f, g, h, i] = values as unknown as number[];
    // prettier-ignore
    const rotation = new Matrix4(a!, b!, c!, 0, d!, e!, f!, 0, g!, h!, i!, 0, 0, 0, 0, 1);
    this.camera.position.fromArray(values).add(world.root.position);
    this.camera.quaternion.setFromRotationMatrix(rotation);
    const height = entry.sensorsize[1] ?? 0;
    const focal = entry.intrinsic[1] ?? 0;
    const fov = height > 0 && focal > 0 ? MathUtils.radToDeg(2 * Math.atan(height / (2 * focal))) : entry.fovy;
    if (fov !== this.camera.fov) this.#lens(fov, this.camera.near, this.camera.far);
    this.camera.updateMatrixWorld();
  }

  #lens(fov: number, near: number, far: number): void {
    Object.assign(this.camera, { fov, near, far });
    this.camera.updateProjectionMatrix();
  }
}

/** Returns the box around bodies in the scene; without bodies, around all that can move, else around all. */
export function boundsOf(world: World, bodies?: readonly number[]): Box3 {
  world.root.updateMatrixWorld();
  const box = new Box3();
  const include = (chosen: (part: Part) => boolean) => {
    for (const part of world.parts) {
      if (part.mesh.visible && part.mesh.frustumCulled && chosen(part)) box.expandByObject(part.mesh);
      else if (part.kind === "flex" || part.kind === "skin") {
        if (part.mesh.visible && chosen(part)) box.expandByObject(part.mesh);
      }
    }
  };
  if (bodies !== undefined) {
    const chosen = new Set(bodies);
    include(({ body, kind }) => kind !== "flex" && chosen.has(body));
    if (box.isEmpty()) for (const body of bodies) box.expandByPoint(world.bodyPoint(body));
    return box;
  }
  include(({ dynamic }) => dynamic);
  if (box.isEmpty()) include(() => true);
  return box;
}
