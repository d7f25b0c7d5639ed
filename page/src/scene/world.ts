import { type Camera, Group, type Object3D, type Texture, Vector3 } from "three";
import type { Info } from "../wire/protocol.ts";
import { Assets } from "./assets.ts";
import { Flex } from "./flex.ts";
import type { Frame } from "./frame.ts";
import { GeomBuilder } from "./geoms.ts";
import { Lights } from "./lights.ts";
import { Looks } from "./looks.ts";
import { Motion } from "./motion.ts";
import { Overlay } from "./overlay.ts";
import type { Pack } from "./pack.ts";
import { GROUPS, GROUP_KINDS, type GroupKind, type Part, VISIBLE_GROUPS } from "./part.ts";
import { Plane, SKY_DISTANCE } from "./planes.ts";
import { Haze } from "./sky.ts";
import { Skin } from "./skin.ts";
import type { Textures } from "./textures.ts";

/** The objects of one server's model. */
export class World {
  /** All objects, in the world frame of the server. Move it to show several servers side by side. */
  readonly root = new Group();
  /** One group for each body, by body id, each a child of `root` with the body's pose in the world frame. */
  readonly bodies: readonly Group[];
  readonly parts: readonly Part[];
  readonly lights: Lights;
  readonly motion = new Motion();
  readonly #looks: Looks;
  readonly #planes: readonly Plane[];
  readonly #flexes: readonly Flex[];
  readonly #skins: readonly Skin[];
  readonly #haze: Haze | null;
  readonly #overlays = new Map<string, Overlay>();
  readonly #groups = new Map<GroupKind, boolean[]>(
    GROUP_KINDS.map((kind) => [kind, Array.from({ length: GROUPS }, (_, group) => group < VISIBLE_GROUPS)]),
  );
  /** Called when the world looks different for another reason than a frame. */
  onChange: () => void = () => undefined;
  #outlined: number | null = null;

  /**
   * @param depth - Number of worlds in the scene before this one.
   */
  constructor(
    readonly server: number,
    readonly name: string,
    public info: Info,
    readonly pack: Pack,
    readonly textures: Textures,
    depth = 0,
  ) {
    const { header } = pack;
    this.root.name = name;
    this.bodies = header.bodies.map(({ name: bodyName, pos, quat }, index) => {
      const body = new Group();
      body.name = bodyName || `body ${index}`;
      body.position.fromArray(pos as number[]);
      body.quaternion.set(quat[1]!, quat[2]!, quat[3]!, quat[0]!);
      this.root.add(body);
      return body;
    });
    this.lights = new Lights(header);
    this.#looks = new Looks(header, textures, this.lights);
    const builder = new GeomBuilder(new Assets(pack), this.#looks, new Set(header.moving));
    const solid = header.geoms.filter(({ type, rgba }) => type !== "plane" && rgba[3]! > 0);
    for (const geom of solid) builder.add("geom", geom);
    for (const site of header.sites) builder.add("site", site);
    const far = header.vis.map.zfar * header.stat.extent;
    const sky = textures.sky;
    this.#planes = header.geoms
      .filter(({ type, rgba }) => type === "plane" && rgba[3]! > 0)
      .map((plane) => new Plane(plane, this.#looks, (sky === null ? 1 : SKY_DISTANCE) * far, depth));
    this.#flexes = header.flexes.map((flex) => new Flex(flex, pack, this.#looks));
    this.#skins = header.skins.map((skin) => new Skin(skin, pack, this.#looks));
    this.parts = [
      ...this.#planes.map(({ part }) => part),
      ...builder.finish(),
      ...this.#flexes.map(({ part }) => part),
      ...this.#skins.map(({ part }) => part),
    ];
    for (const { mesh, kind, body } of this.parts) {
      // Vertices of flexes and skins are in the world frame.
      (kind === "geom" || kind === "site" ? this.bodies[body]! : this.root).add(mesh);
    }
    const horizon = this.#planes.find(({ endless }) => endless);
    this.#haze =
      sky !== null && horizon !== undefined
        ? new Haze(horizon.part.mesh, header.vis.map.haze, header.vis.rgba.haze, far)
        : null;
    if (this.#haze !== null) this.root.add(this.#haze.mesh);
    for (const kind of GROUP_KINDS) this.#showGroups(kind);
    this.#moveVertices(null);
  }

  /** The newest frame, if any. */
  get frame(): Frame | null {
    return this.motion.frame;
  }

  /** The skybox of the model, if it has one. */
  get sky(): Texture | null {
    return this.textures.sky;
  }

  /** The body that is outlined, if any. */
  get outlined(): number | null {
    return this.#outlined;
  }

  /** Takes a frame; the bodies move when the scene is drawn. */
  apply(frame: Frame, now = performance.now() / 1000, smooth = false): void {
    this.motion.push(frame, now, smooth);
  }

  /** Moves the bodies to where they are at a wall time of the page [s]; returns whether anything has moved. */
  advance(now: number): boolean {
    if (!this.motion.advance(now)) return false;
    const { bodies: poses } = this.motion;
    this.pack.header.moving.forEach((id, index) => {
      const body = this.bodies[id]!;
      const start = 7 * index;
      body.position.fromArray(poses, start);
      body.quaternion.set(poses[start + 4]!, poses[start + 5]!, poses[start + 6]!, poses[start + 3]!);
    });
    this.#moveVertices(this.motion.vertices);
    return true;
  }

  /** Adapts what depends on the camera; call it before the scene is drawn with a camera. */
  prepare(camera: Camera): void {
    this.root.updateMatrixWorld();
    this.lights.update(this.bodies, this.root, camera);
    for (const plane of this.#planes) plane.update(camera);
    this.#haze?.update(camera);
  }

  /** Shows the shapes of `@view/overlay/<kind>`; null removes them. */
  setOverlay(kind: string, payload: DataView<ArrayBuffer> | null): void {
    const shown = this.#overlays.get(kind);
    if (payload === null) {
      shown?.dispose();
      this.#overlays.delete(kind);
      this.onChange();
      return;
    }
    const overlay = shown ?? new Overlay(this.lights);
    if (shown === undefined) {
      this.#overlays.set(kind, overlay);
      this.root.add(overlay.root);
    }
    overlay.apply(payload);
    this.onChange();
  }

  /** The overlays that are shown, by kind. */
  get overlays(): ReadonlyMap<string, Overlay> {
    return this.#overlays;
  }

  /** Shows or hides a group. */
  setGroup(kind: GroupKind, group: number, visible: boolean): void {
    this.#groups.get(kind)![group] = visible;
    this.#showGroups(kind);
    this.onChange();
  }

  groupVisible(kind: GroupKind, group: number): boolean {
    return this.#groups.get(kind)![group] ?? false;
  }

  /** Returns the groups of a kind that contain anything, in ascending order. */
  usedGroups(kind: GroupKind): number[] {
    const used = new Set(this.parts.filter((part) => part.kind === kind).map(({ group }) => group));
    return [...used].sort((a, b) => a - b);
  }

  /** Draws moving bodies as transparent, as MuJoCo does. */
  setTransparent(on: boolean): void {
    const factor = on ? this.pack.header.vis.map.alpha : 1;
    for (const { mesh, dynamic } of this.parts) if (dynamic) mesh.material.fade(factor);
    this.onChange();
  }

  setWireframe(on: boolean): void {
    this.#looks.setWireframe(on);
    this.onChange();
  }

  /** Outlines a body; null outlines none. */
  outline(body: number | null): void {
    this.#outlined = body;
    this.onChange();
  }

  /** Returns the point of a body in the scene [m]. */
  bodyPoint(body: number, local: readonly [number, number, number] = [0, 0, 0]): Vector3 {
    const group = this.bodies[body]!;
    const point = new Vector3(...local).applyQuaternion(group.quaternion).add(group.position);
    this.root.updateMatrixWorld();
    return this.root.localToWorld(point);
  }

  /** Frees the memory of the graphics card. */
  dispose(): void {
    this.root.removeFromParent();
    for (const kind of [...this.#overlays.keys()]) this.setOverlay(kind, null);
    for (const { mesh } of this.parts) mesh.geometry.dispose();
    this.#haze?.dispose();
    this.#looks.dispose();
    this.textures.dispose();
  }

  #showGroups(kind: GroupKind): void {
    const groups = this.#groups.get(kind)!;
    for (const { mesh, kind: own, group } of this.parts) if (own === kind) mesh.visible = groups[group]!;
  }

  #moveVertices(vertices: Float32Array | null): void {
    if (vertices !== null) for (const flex of this.#flexes) flex.update(vertices);
    for (const skin of this.#skins) skin.update(this.bodies as readonly Object3D[]);
  }
}
