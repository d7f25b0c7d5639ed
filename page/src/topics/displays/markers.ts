import { InstancedMesh, type Material, Mesh, type Object3D, Sprite } from "three";
import { LineSegments2 } from "three/addons/lines/LineSegments2.js";
import type { Fields } from "../../wire/protocol.ts";
import { seconds, stampOf } from "../messages.ts";
import type { Display, DisplayContext } from "./display.ts";
import { type Marker, markerShape } from "./marker.ts";

interface Shown {
  readonly object: Object3D;
  /** Simulated time at which the marker disappears [s]. */
  readonly until: number;
}

const DELETE = 2;
const DELETE_ALL = 3;
/** A topic that adds ever new markers must not fill the memory. */
const MOST = 5000;

/** Markers as in RViz: arrows, boxes, spheres, cylinders, lines, lists, triangles and texts. */
export class MarkersDisplay implements Display {
  // Each message changes some of the markers, so none may be left out.
  readonly all = true;
  readonly #shown = new Map<string, Shown>();

  constructor(readonly context: DisplayContext) {}

  show(message: Fields): void {
    const markers = (message["markers"] as readonly Marker[] | undefined) ?? [message as unknown as Marker];
    const problems = new Set<string>();
    for (const marker of markers) {
      try {
        this.#apply(marker);
      } catch (error) {
        problems.add((error as Error).message);
      }
    }
    if (problems.size > 0) throw new Error([...problems].join(" "));
  }

  update(): boolean {
    const now = this.context.now();
    let changed = false;
    for (const [key, { until }] of this.#shown) {
      if (now !== null && now > until) {
        this.#remove(key);
        changed = true;
      }
    }
    return changed;
  }

  summary(): string {
    return this.#shown.size === 1 ? "1 marker" : `${this.#shown.size} markers`;
  }

  dispose(): void {
    for (const key of [...this.#shown.keys()]) this.#remove(key);
  }

  #apply(marker: Marker): void {
    const key = `${marker.ns}\n${marker.id}`;
    if (marker.action === DELETE_ALL) {
      for (const shown of [...this.#shown.keys()]) {
        if (marker.ns === "" || shown.startsWith(`${marker.ns}\n`)) this.#remove(shown);
      }
      return;
    }
    this.#remove(key);
    if (marker.action === DELETE) return;
    if (this.#shown.size >= MOST) throw new Error(`Only the first ${MOST} markers are shown.`);
    const object = markerShape(marker);
    this.context.group.add(object);
    this.context.placement.set(object, marker.header.frame_id, marker.frame_locked ? null : stampOf(marker.header));
    const lifetime = seconds(marker.lifetime);
    const now = this.context.now();
    this.#shown.set(key, { object, until: lifetime > 0 && now !== null ? now + lifetime : Infinity });
  }

  #remove(key: string): void {
    const shown = this.#shown.get(key);
    if (shown === undefined) return;
    this.#shown.delete(key);
    this.context.placement.delete(shown.object);
    shown.object.removeFromParent();
    shown.object.traverse(free);
  }
}

function free(object: Object3D): void {
  if (object instanceof Sprite) {
    object.material.map?.dispose();
    object.material.dispose();
  } else if (object instanceof Mesh) {
    if (object instanceof InstancedMesh) object.dispose();
    // Other geometries are shared by all markers.
    if (object instanceof LineSegments2 || object.userData["own"] === true) object.geometry.dispose();
    (object.material as Material).dispose();
  }
}
