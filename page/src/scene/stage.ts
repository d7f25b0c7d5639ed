import { Object3D, PerspectiveCamera, Scene, type Vector3, WebGLRenderer } from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import type { Info } from "../wire/protocol.ts";
import type { Source } from "../wire/source.ts";
import { readFrame } from "./frame.ts";
import { Pack } from "./pack.ts";
import { World } from "./world.ts";

Object3D.DEFAULT_UP.set(0, 0, 1);

/** A point of a body under the mouse. */
export interface Picked {
  readonly world: World;
  readonly body: number;
  /** In the world frame [m]. */
  readonly point: Vector3;
}

/** The 3D scene: camera, canvas and a `World` for each watched server. It draws only when something has changed. */
export class Stage {
  readonly scene = new Scene();
  readonly camera = new PerspectiveCamera(45, 1, 0.01, 1000);
  readonly renderer: WebGLRenderer;
  readonly controls: OrbitControls;
  readonly worlds = new Map<number, World>();
  readonly #beforeDraw: ((seconds: number) => void)[] = [];
  readonly #onWorld: ((world: World) => void)[] = [];
  #dirty = true;
  #last = 0;

  constructor(
    readonly container: HTMLElement,
    readonly source: Source,
  ) {
    this.renderer = new WebGLRenderer({ antialias: true });
    container.append(this.renderer.domElement);
    this.camera.position.set(2, -2, 1.5);
    this.controls = new OrbitControls(this.camera, this.renderer.domElement);
    this.controls.addEventListener("change", () => this.invalidate());
    new ResizeObserver(() => this.#resize()).observe(container);
    source.listen({
      onInfo: (server, info) => void this.#show(server, info),
      onFrame: (server, payload) => {
        this.worlds.get(server)?.apply(readFrame(payload));
        this.invalidate();
      },
    });
    requestAnimationFrame((now) => this.#loop(now));
  }

  get canvas(): HTMLCanvasElement {
    return this.renderer.domElement;
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

  async #show(server: number, info: Info): Promise<void> {
    const shown = this.worlds.get(server);
    if (shown !== undefined && shown.info.scene === info.scene) {
      shown.info = info;
      return;
    }
    const pack = new Pack(await this.source.scene(info.scene));
    shown?.dispose();
    const world = new World(server, info.name, info, pack);
    this.worlds.set(server, world);
    this.scene.add(world.root);
    for (const callback of this.#onWorld) callback(world);
    this.invalidate();
  }

  #resize(): void {
    const { clientWidth, clientHeight } = this.container;
    this.renderer.setPixelRatio(window.devicePixelRatio);
    this.renderer.setSize(clientWidth, clientHeight, false);
    this.camera.aspect = clientWidth / Math.max(1, clientHeight);
    this.camera.updateProjectionMatrix();
    this.invalidate();
  }

  #loop(now: number): void {
    requestAnimationFrame((next) => this.#loop(next));
    const seconds = (now - this.#last) / 1000;
    this.#last = now;
    for (const callback of this.#beforeDraw) callback(seconds);
    if (this.#dirty) {
      this.#dirty = false;
      this.renderer.render(this.scene, this.camera);
    }
    this.source.drawn();
  }
}
