import {
  CylinderGeometry,
  Group,
  Mesh,
  MeshBasicMaterial,
  type PerspectiveCamera,
  SphereGeometry,
  Vector3,
} from "three";

const UP = new Vector3(0, 1, 0);
/** Thickness as a share of the distance from the camera. */
const WIDTH = 0.0022;
const BALL = 0.009;

/** A line from the grabbed point to the target, visible through everything. */
export class DragLine {
  readonly root = new Group();
  readonly #line: Mesh;
  readonly #ends: readonly [Mesh, Mesh];

  constructor() {
    const material = new MeshBasicMaterial({ color: 0xff9f1a, depthTest: false, transparent: true });
    this.#line = new Mesh(new CylinderGeometry(1, 1, 1, 8), material);
    const ball = new SphereGeometry(1, 16, 12);
    this.#ends = [new Mesh(ball, material), new Mesh(ball, material)];
    this.root.add(this.#line, ...this.#ends);
    this.root.traverse((part) => {
      part.renderOrder = 1000;
      part.frustumCulled = false;
      // It must never be picked.
      part.raycast = () => undefined;
    });
    this.root.visible = false;
  }

  hide(): void {
    this.root.visible = false;
  }

  /** Draws the line between two points of the scene. */
  show(from: Vector3, to: Vector3, camera: PerspectiveCamera): void {
    const way = new Vector3().subVectors(to, from);
    const length = way.length();
    const middle = from.clone().addScaledVector(way, 0.5);
    const scale = camera.position.distanceTo(middle) * Math.tan((camera.fov * Math.PI) / 360);
    this.#line.visible = length > 1e-6;
    this.#line.position.copy(middle);
    this.#line.scale.set(scale * WIDTH, Math.max(length, 1e-6), scale * WIDTH);
    this.#line.quaternion.setFromUnitVectors(UP, length > 1e-6 ? way.divideScalar(length) : UP);
    this.#ends[0].position.copy(from);
    this.#ends[0].scale.setScalar(0.6 * scale * BALL);
    this.#ends[1].position.copy(to);
    this.#ends[1].scale.setScalar(scale * BALL);
    this.root.visible = true;
  }
}
