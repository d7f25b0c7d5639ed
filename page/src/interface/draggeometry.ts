import { Plane, Quaternion, type Ray, Vector3 } from "three";

/** In which plane the target of a drag moves. */
export type DragPlane = "camera" | "horizontal";

const UP = new Vector3(0, 0, 1);
/** A ray that meets the plane at a smaller angle than this [rad] would move the target very far. */
const MIN_ANGLE = 0.05;
/** Turn for a movement over the height of the picture [rad]. */
const TURN = Math.PI;

/** Moves the target of a pull in a plane, as the mouse moves. */
export class PullTarget {
  /** In the world frame [m]. */
  readonly target: Vector3;
  readonly #plane = new Plane();
  readonly #offset = new Vector3();

  /** @param grabbed - The point that is pulled, in the world frame [m]. */
  constructor(grabbed: Vector3) {
    this.target = grabbed.clone();
  }

  /**
   * Begins to move in a plane through the target. The target stays where it is until the mouse moves.
   *
   * @param kind - The plane that faces the camera, or the horizontal one.
   * @param ray - From the camera through the mouse.
   * @param view - Direction in which the camera looks.
   */
  start(kind: DragPlane, ray: Ray, view: Vector3): void {
    const normal = kind === "horizontal" ? UP : view.clone().normalize();
    this.#plane.setFromNormalAndCoplanarPoint(normal, this.target);
    const hit = this.#hit(ray);
    this.#offset.set(0, 0, 0);
    if (hit !== null) this.#offset.subVectors(this.target, hit);
  }

  /** Moves the target with the mouse; a ray that does not meet the plane leaves it where it is. */
  move(ray: Ray): void {
    const hit = this.#hit(ray);
    if (hit !== null) this.target.addVectors(hit, this.#offset);
  }

  #hit(ray: Ray): Vector3 | null {
    if (Math.abs(ray.direction.dot(this.#plane.normal)) < Math.sin(MIN_ANGLE)) return null;
    return ray.intersectPlane(this.#plane, new Vector3());
  }
}

/**
 * Returns the orientation of a body that is turned with the mouse, as if the mouse held its near side.
 *
 * @param start - Orientation of the body when the drag began.
 * @param camera - Orientation of the camera.
 * @param right - Movement of the mouse to the right, as a share of the height of the picture.
 * @param down - Movement of the mouse downwards, in the same unit.
 */
export function turned(start: Quaternion, camera: Quaternion, right: number, down: number): Quaternion {
  const way = Math.hypot(right, down);
  if (way === 0) return start.clone();
  const axis = new Vector3(down / way, right / way, 0).applyQuaternion(camera);
  return new Quaternion().setFromAxisAngle(axis, TURN * way).multiply(start);
}
