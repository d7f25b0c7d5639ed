import { type Camera, type Intersection, Raycaster, type Vector2, type Vector3 } from "three";
import type { Part } from "./part.ts";
import type { World } from "./world.ts";

/** A point of a body under the mouse. */
export interface Picked {
  readonly world: World;
  readonly body: number;
  /** In the scene [m]; this is the world frame if the world has not been moved. */
  readonly point: Vector3;
  /** Name of the geom, site, flex or skin; empty if it has none. */
  readonly name: string;
  /** From the camera [m]. */
  readonly distance: number;
}

const raycaster = new Raycaster();

/**
 * Returns what is nearest to the camera at a place of the picture, or null.
 *
 * @param place - From -1 to 1, x to the right and y upwards.
 */
export function pick(worlds: Iterable<World>, camera: Camera, place: Vector2): Picked | null {
  raycaster.setFromCamera(place, camera);
  let best: Picked | null = null;
  for (const world of worlds) {
    for (const part of world.parts) {
      if (!part.mesh.visible) continue;
      raycaster.far = best?.distance ?? Infinity;
      const [hit] = raycaster.intersectObject(part.mesh, false);
      if (hit !== undefined && (best === null || hit.distance < best.distance)) {
        best = { world, body: part.body, point: hit.point, name: nameOf(world, part, hit), distance: hit.distance };
      }
    }
  }
  return best;
}

function nameOf(world: World, part: Part, { faceIndex }: Intersection): string {
  const { header } = world.pack;
  if (part.kind === "flex" || part.kind === "skin") return "";
  const corner = 3 * (faceIndex ?? 0);
  const found = part.shapes.filter((shape) => shape.corner <= corner).at(-1);
  const entries = part.kind === "geom" ? header.geoms : header.sites;
  return entries.find(({ id }) => id === found?.id)?.name ?? "";
}
