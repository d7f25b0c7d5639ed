import { AmbientLight, DirectionalLight, PerspectiveCamera, Scene, Vector2, Vector3, type WebGLRenderer } from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import { element } from "../interface/element.ts";
import type { Info } from "../wire/protocol.ts";
import type { Source } from "../wire/source.ts";
import { readFrame } from "./frame.ts";
import { type Graphics, openGraphics, pixelRatio } from "./graphics.ts";
import { Outline } from "./outline.ts";
import { Pack } from "./pack.ts";
import { type Picked, pick } from "./picking.ts";
import { Shadows } from "./shadows.ts";
import { Sky, type Theme } from "./sky.ts";
import { Counter, type Statistics } from "./statistics.ts";
import { Textures } from "./textures.ts";
import { Viewpoint } from "./viewpoint.ts";
import { World } from "./world.ts";

export type { Picked } from "./picking.ts";

/** Pictures per frame above which motion between frames is shown. */
const SMOOTH_FROM = 1.5;

/** The 3D scene: camera, canvas and a `World` for each watched server. It draws only when something has changed. */
export class Stage {
  readonly scene = new Scene();
  readonly camera = new PerspectiveCamera(45, 1, 0.01, 1000);
  readonly canvas = element("canvas", { className: "canvas" });
  readonly controls: OrbitControls;
  readonly viewpoint: Viewpoint;
  readonly worlds = new Map<number, World>();
  readonly #graphics: Graphics | null;
  readonly #sky = new Sky();
  readonly #shadows = new Shadows(this.scene);
  readonly #counter = new Counter();
  readonly #beforeDraw: ((seconds: number) => void)[] = [];
  readonly #onWorld: ((world: World) => void)[] = [];
  readonly #onRemove: ((world: World) => void)[] = [];
  readonly #loading = new Map<number, string>();
  readonly #offsets = new Map<number, Vector3>();
  readonly #message = element("p", { className: "stage-message", hidden: true });
  #outline: Outline | null = null;
  #dirty = true;
  #last = 0;
  #drawsSinceFrame = 0;
  #drawsPerFrame = 1;
  #lost = false;

  constructor(
    readonly container: HTMLElement,
    readonly source: Source,
  ) {
    container.append(this.canvas, this.#message);
    this.canvas.tabIndex = 0;
    this.#graphics = openGraphics(this.canvas, new URLSearchParams(location.search).has("smooth"));
    if (this.#graphics === null) {
      this.#say("This browser offers no WebGL 2, so the scene cannot be drawn. Everything else on this page works.");
    }
    this.camera.position.set(2, -2, 1.5);
    this.controls = new OrbitControls(this.camera, this.canvas);
    this.controls.addEventListener("change", () => this.invalidate());
    this.viewpoint = new Viewpoint(this.camera, this.controls);
    this.scene.add(this.#sky.mesh, this.camera);
    // These light what other features add to the scene; models have lights of their own.
    const lamp = new DirectionalLight(0xffffff, 0.6 * Math.PI);
    lamp.position.set(0, 0, 1);
    lamp.target.position.set(0, 0, 0);
    this.camera.add(lamp, lamp.target);
    this.scene.add(new AmbientLight(0xffffff, 0.4 * Math.PI));
    new ResizeObserver(() => this.#resize()).observe(container);
    this.canvas.addEventListener("webglcontextlost", (event) => {
      event.preventDefault();
      this.#lost = true;
      this.#say("The graphics card has reset. The scene is drawn again as soon as the browser allows it.");
    });
    this.canvas.addEventListener("webglcontextrestored", () => {
      this.#lost = false;
      this.#message.hidden = true;
      this.invalidate();
    });
    source.listen({
      onInfo: (server, info) => void this.#show(server, info),
      onFrame: (server, payload) => this.#frame(server, payload),
      onOverlay: (server, kind, payload) => {
        this.#counter.bytes += payload.byteLength;
        this.worlds.get(server)?.setOverlay(kind, payload);
      },
    });
    requestAnimationFrame((now) => this.#loop(now));
  }

  /** The renderer of three.js.
   *
   * @throws Error if the browser has no WebGL.
   */
  get renderer(): WebGLRenderer {
    if (this.#graphics === null) throw new Error("This browser offers no WebGL 2.");
    return this.#graphics.renderer;
  }

  /** Whether the processor draws, so that costly effects should be off. */
  get software(): boolean {
    return this.#graphics?.software ?? true;
  }

  /** Number of pictures drawn. */
  get drawn(): number {
    return this.#counter.drawn;
  }

  /** Draws again in the next animation frame. */
  invalidate(): void {
    this.#dirty = true;
  }

  /** Calls a function before each animation frame with the time since the last one [s]; it may call `invalidate`. */
  beforeDraw(callback: (seconds: number) => void): void {
    this.#beforeDraw.push(callback);
  }

  /** Calls a function with each new world; a world of the same server replaces the one before. */
  onWorld(callback: (world: World) => void): void {
    this.#onWorld.push(callback);
  }

  /** Calls a function with each world that was removed without another one in its place. */
  onRemove(callback: (world: World) => void): void {
    this.#onRemove.push(callback);
  }

  /** Returns the nearest visible point of a body at a place of the page [px], or null. */
  pick(clientX: number, clientY: number): Picked | null {
    const { left, top, width, height } = this.canvas.getBoundingClientRect();
    const place = new Vector2((2 * (clientX - left)) / width - 1, 1 - (2 * (clientY - top)) / height);
    this.camera.updateMatrixWorld();
    return pick(this.#visible(), this.camera, place);
  }

  /** Returns the place on the page [px] of a point of a body; null if it is behind the camera. */
  project(world: World, body: number, local?: readonly [number, number, number]): { x: number; y: number } | null {
    return this.projectPoint(world.bodyPoint(body, local));
  }

  /** Returns the place on the page [px] of a point of the scene; null if it is behind the camera. */
  projectPoint(point: Vector3): { x: number; y: number } | null {
    this.camera.updateMatrixWorld();
    const seen = point.clone().applyMatrix4(this.camera.matrixWorldInverse);
    if (seen.z >= 0) return null;
    seen.applyMatrix4(this.camera.projectionMatrix);
    const { left, top, width, height } = this.canvas.getBoundingClientRect();
    return { x: left + ((1 + seen.x) / 2) * width, y: top + ((1 - seen.y) / 2) * height };
  }

  /** Moves the camera so that bodies of a world are in the picture; without bodies, all that can move. */
  fit(bodies?: readonly number[], world = this.#first()): void {
    if (world !== undefined) this.viewpoint.fit(world, bodies);
    this.invalidate();
  }

  /** Looks from where MuJoCo's viewers start. */
  resetCamera(world = this.#first()): void {
    if (world !== undefined) this.viewpoint.reset(world);
    this.invalidate();
  }

  /** Moves the camera with a body; null ends it. */
  follow(world: World, body: number | null): void {
    this.viewpoint.follow(world, body);
  }

  /** Looks through a camera of the model; null returns to the free camera. */
  lookThrough(world: World, camera: number | null): void {
    this.viewpoint.lookThrough(world, camera);
    this.invalidate();
  }

  /** Colours of the background of models without a skybox. */
  background(theme: Theme): void {
    this.#sky.setTheme(theme);
    this.invalidate();
  }

  /** Moves everything of a server in the scene [m]; also a model that it loads later. */
  setOffset(server: number, offset: readonly [number, number, number]): void {
    const vector = new Vector3(...offset);
    this.#offsets.set(server, vector);
    this.worlds.get(server)?.root.position.copy(vector);
    this.invalidate();
  }

  /** Switches shadows; at first they are on if there is a graphics card. */
  setShadows(on: boolean): void {
    if (this.#graphics === null) return;
    this.#graphics.renderer.shadowMap.enabled = on;
    this.#castShadows();
  }

  /** Removes the world of a server, for example because it is no longer watched. */
  remove(server: number): void {
    // Also a model that is still being loaded must not appear.
    this.#loading.delete(server);
    const world = this.worlds.get(server);
    if (world === undefined) return;
    this.viewpoint.forget(world);
    world.dispose();
    this.worlds.delete(server);
    for (const callback of this.#onRemove) callback(world);
    this.#sky.setTexture(this.#first()?.sky ?? null);
    this.#castShadows();
  }

  /** Returns the picture as a PNG file. */
  snapshot(): Promise<Blob | null> {
    // The browser keeps what was drawn only until the end of this task.
    this.#draw();
    return new Promise((resolve) => this.canvas.toBlob(resolve, "image/png"));
  }

  /** Returns what was received and drawn. */
  statistics(): Statistics {
    const counter = this.#counter;
    const info = this.#graphics?.renderer.info;
    return {
      frames: counter.frames,
      applied: counter.applied,
      bytes: counter.bytes,
      drawn: counter.drawn,
      draw_calls: info?.render.calls ?? 0,
      triangles: info?.render.triangles ?? 0,
      geometries: info?.memory.geometries ?? 0,
      textures: info?.memory.textures ?? 0,
      programs: info?.programs?.length ?? 0,
      meshes: [...this.worlds.values()].reduce((sum, { parts }) => sum + parts.length, 0),
      median_age: counter.medianAge,
      draw_time: counter.drawTime,
      renderer: this.#graphics?.name ?? "",
    };
  }

  /** The visible worlds, in the order of their servers. */
  #visible(): World[] {
    return [...this.worlds.values()].filter(({ root }) => root.visible).sort((a, b) => a.server - b.server);
  }

  #first(): World | undefined {
    return this.#visible()[0];
  }

  /** Lets the lights of the first world cast shadows, because each shadow costs time for every pixel. */
  #castShadows(): void {
    const enabled = this.#graphics?.renderer.shadowMap.enabled ?? false;
    this.#shadows.show(enabled ? (this.#first() ?? null) : null);
    for (const world of this.worlds.values()) for (const { mesh } of world.parts) mesh.material.needsUpdate = true;
    this.invalidate();
  }

  #say(text: string): void {
    this.#message.textContent = text;
    this.#message.hidden = false;
  }

  async #show(server: number, info: Info): Promise<void> {
    const shown = this.worlds.get(server);
    if (shown !== undefined && shown.info.scene === info.scene) {
      shown.info = info;
      this.#loading.delete(server);
      return;
    }
    if (this.#loading.get(server) === info.scene) return;
    this.#loading.set(server, info.scene);
    try {
      const pack = new Pack(await this.source.scene(info.scene));
      const textures = await Textures.load(pack);
      if (this.#loading.get(server) !== info.scene) {
        textures.dispose();
        return;
      }
      this.#counter.bytes += info.scene_bytes;
      this.#place(server, info, pack, textures);
    } catch (error) {
      this.#say(error instanceof Error ? error.message : String(error));
    } finally {
      if (this.#loading.get(server) === info.scene) this.#loading.delete(server);
    }
  }

  #place(server: number, info: Info, pack: Pack, textures: Textures): void {
    const before = this.worlds.get(server);
    if (before !== undefined) {
      this.viewpoint.forget(before);
      this.#shadows.show(null);
      before.dispose();
    }
    textures.setAnisotropy(this.#graphics?.anisotropy ?? 1);
    const world = new World(server, info.name, info, pack, textures, this.worlds.size - (before === undefined ? 0 : 1));
    const offset = this.#offsets.get(server);
    if (offset !== undefined) world.root.position.copy(offset);
    world.onChange = () => this.invalidate();
    this.worlds.set(server, world);
    this.scene.add(world.root);
    if (world === this.#first()) {
      this.#sky.setTexture(world.sky);
      this.viewpoint.reset(world);
      this.#castShadows();
    }
    this.#message.hidden = true;
    for (const callback of this.#onWorld) callback(world);
    this.invalidate();
  }

  #frame(server: number, payload: DataView<ArrayBuffer>): void {
    this.#counter.frames += 1;
    this.#counter.bytes += payload.byteLength;
    this.#drawsPerFrame += 0.1 * (this.#drawsSinceFrame - this.#drawsPerFrame);
    this.#drawsSinceFrame = 0;
    const smooth = this.#drawsPerFrame > SMOOTH_FROM;
    this.worlds.get(server)?.apply(readFrame(payload), performance.now() / 1000, smooth);
  }

  #resize(): void {
    const { clientWidth, clientHeight } = this.container;
    const graphics = this.#graphics;
    if (graphics !== null) {
      graphics.renderer.setPixelRatio(
        pixelRatio(clientWidth, clientHeight, window.devicePixelRatio, graphics.software),
      );
      graphics.renderer.setSize(clientWidth, clientHeight, false);
    }
    this.camera.aspect = clientWidth / Math.max(1, clientHeight);
    this.camera.updateProjectionMatrix();
    this.#draw();
  }

  #loop(now: number): void {
    requestAnimationFrame((next) => this.#loop(next));
    const seconds = (now - this.#last) / 1000;
    this.#last = now;
    this.#drawsSinceFrame += 1;
    for (const callback of this.#beforeDraw) callback(seconds);
    for (const world of this.worlds.values()) {
      const { frame, moving } = world.motion;
      if (!world.advance(performance.now() / 1000)) continue;
      this.invalidate();
      if (moving && !world.motion.moving && frame !== null) {
        this.#counter.applied += 1;
        this.#counter.age(frame.wallTime, Date.now() / 1000);
      }
    }
    if (this.#dirty) this.#draw();
    this.source.drawn();
  }

  #draw(): void {
    this.#dirty = false;
    if (this.#graphics === null || this.#lost) return;
    const started = performance.now();
    const { renderer } = this.#graphics;
    this.viewpoint.update();
    this.camera.updateMatrixWorld();
    for (const world of this.worlds.values()) world.prepare(this.camera);
    this.#shadows.update();
    renderer.info.reset();
    renderer.render(this.scene, this.camera);
    this.#outline ??= new Outline(renderer);
    this.#outline.draw(this.scene, this.#visible(), this.camera);
    this.#counter.drawn += 1;
    this.#counter.drawTime = performance.now() - started;
  }
}
