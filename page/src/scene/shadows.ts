import { DirectionalLight, MathUtils, type Scene, SpotLight, Vector3 } from "three";
import { lightPose } from "./lights.ts";
import type { LightEntry } from "./pack.ts";
import type { World } from "./world.ts";

/** The shader has space for this number of shadows of each kind of light. */
const MAX_SHADOWS = 2;

const MAP_SIZE = 2048;

/** The first number of shadows of spot lights. */
const SPOT_SLOT = 2;

/** Wider spots would have shadows of few pixels [degrees]. */
const MAX_ANGLE = 160;

/** Distance from which on a spot light casts shadows, as a fraction of the model's extent. */
const SPOT_NEAR = 0.1;

interface Caster {
  readonly world: World;
  readonly entry: LightEntry;
  readonly light: DirectionalLight | SpotLight;
}

/** Shadows of the lights of one world. The lights of three.js serve for their shadows only; they do not shine. */
export class Shadows {
  readonly #casters: Caster[] = [];
  readonly #position = new Vector3();
  readonly #direction = new Vector3();

  constructor(readonly scene: Scene) {}

  /** Lets the lights of a world cast shadows; null ends it. */
  show(world: World | null): void {
    for (const { world: before, entry, light } of this.#casters.splice(0)) {
      before.lights.setShadow(entry, -1);
      light.removeFromParent();
      light.target.removeFromParent();
      light.dispose();
    }
    if (world === null) return;
    for (const [type, slot] of [
      ["directional", 0],
      ["spot", SPOT_SLOT],
    ] as const) {
      const casting = world.lights.entries.filter((entry) => entry.type === type && entry.castshadow);
      casting.slice(0, MAX_SHADOWS).forEach((entry, index) => {
        world.lights.setShadow(entry, slot + index);
        this.#casters.push({ world, entry, light: this.#make(world, entry) });
      });
    }
    for (const { mesh, kind, shadow } of world.parts) {
      // Sites are no part of the robot, and planes have nothing below them.
      mesh.castShadow = kind !== "site" && shadow && !mesh.material.transparent;
      mesh.receiveShadow = !mesh.material.transparent;
    }
  }

  /** Moves the lights; call it before the scene is drawn. */
  update(): void {
    for (const { world, entry, light } of this.#casters) {
      lightPose(entry, world.bodies, world.root.matrixWorld, this.#position, this.#direction);
      light.position.copy(this.#position);
      light.target.position.copy(this.#position).add(this.#direction);
      light.target.updateMatrixWorld();
    }
  }

  #make(world: World, entry: LightEntry): DirectionalLight | SpotLight {
    const { vis, stat } = world.pack.header;
    const [near, far] = [vis.map.znear * stat.extent, vis.map.zfar * stat.extent];
    let light: DirectionalLight | SpotLight;
    if (entry.type === "directional") {
      light = new DirectionalLight(0x000000);
      const clip = vis.map.shadowclip * stat.extent;
      Object.assign(light.shadow.camera, { left: -clip, right: clip, bottom: -clip, top: clip, near, far });
    } else {
      light = new SpotLight(0x000000);
      const angle = Math.min(2 * entry.cutoff * vis.map.shadowscale, MAX_ANGLE);
      light.angle = MathUtils.degToRad(angle / 2);
      light.distance = far;
      // Depths are most precise near the light, where nothing is.
      Object.assign(light.shadow.camera, { near: SPOT_NEAR * stat.extent, far });
    }
    light.castShadow = true;
    light.shadow.mapSize.set(MAP_SIZE, MAP_SIZE);
    light.shadow.radius = 1.5;
    light.shadow.bias = -3e-5;
    light.shadow.normalBias = 0.002 * stat.extent;
    this.scene.add(light, light.target);
    return light;
  }
}
