import {
  BackSide,
  BoxGeometry,
  BufferAttribute,
  BufferGeometry,
  type Camera,
  Color,
  DoubleSide,
  Mesh,
  MeshBasicMaterial,
  ShaderMaterial,
  type Texture,
  Vector3,
} from "three";
import { SKY_DISTANCE } from "./planes.ts";

const SLICES = 64;

/** Colours above and below the horizon for models without a skybox. */
const GRADIENTS = {
  dark: [new Color("#3d4651"), new Color("#14181d")],
  light: [new Color("#f4f7fa"), new Color("#c3ccd6")],
} as const;

export type Theme = keyof typeof GRADIENTS;

/** The background of the scene: a model's skybox, or a gradient in the colours of the page. */
export class Sky {
  readonly mesh: Mesh<BoxGeometry, ShaderMaterial>;

  constructor() {
    const material = new ShaderMaterial({
      vertexShader: VERTEX,
      fragmentShader: FRAGMENT,
      side: BackSide,
      depthTest: false,
      depthWrite: false,
      uniforms: { sky: { value: null }, upper: { value: GRADIENTS.dark[0] }, lower: { value: GRADIENTS.dark[1] } },
    });
    this.mesh = new Mesh(new BoxGeometry(2, 2, 2), material);
    this.mesh.frustumCulled = false;
    this.mesh.renderOrder = -1000;
    this.mesh.raycast = () => undefined;
  }

  /** Shows the skybox of a model, or the gradient if it is null. */
  setTexture(texture: Texture | null): void {
    const { material } = this.mesh;
    material.uniforms["sky"]!.value = texture;
    material.defines = texture === null ? {} : { SKY: "" };
    material.needsUpdate = true;
  }

  setTheme(theme: Theme): void {
    const [upper, lower] = GRADIENTS[theme];
    this.mesh.material.uniforms["upper"]!.value = upper;
    this.mesh.material.uniforms["lower"]!.value = lower;
  }
}

const VERTEX = `
varying vec3 toSky;
void main() {
  toSky = position;
  vec4 seen = projectionMatrix * vec4(mat3(viewMatrix) * position, 1.0);
  gl_Position = seen.xyww;
}`;

/** MuJoCo turns the skybox by 90 degrees about x. */
const FRAGMENT = `
varying vec3 toSky;
uniform samplerCube sky;
uniform vec3 upper;
uniform vec3 lower;
void main() {
#ifdef SKY
  gl_FragColor = vec4(textureCube(sky, vec3(toSky.x, toSky.z, -toSky.y)).rgb, 1.0);
#else
  gl_FragColor = vec4(mix(lower, upper, smoothstep(-0.6, 0.8, normalize(toSky).z)), 1.0);
#endif
}`;

/** The haze that hides where an infinite plane ends, as in MuJoCo's renderer. */
export class Haze {
  readonly mesh: Mesh<BufferGeometry, MeshBasicMaterial>;
  readonly #normal = new Vector3();
  readonly #offset = new Vector3();

  /**
   * @param plane - The mesh of the infinite plane.
   * @param fraction - Part of the distance to the horizon that has haze: `visual/map/haze`.
   * @param color - `visual/rgba/haze`.
   * @param distance - Distance of the far clipping plane [m].
   */
  constructor(
    readonly plane: Mesh,
    fraction: number,
    color: readonly number[],
    readonly distance: number,
  ) {
    const material = new MeshBasicMaterial({
      vertexColors: true,
      transparent: true,
      depthWrite: false,
      side: DoubleSide,
    });
    this.mesh = new Mesh(hazeGeometry(fraction, color), material);
    this.mesh.matrixAutoUpdate = false;
    this.mesh.frustumCulled = false;
    this.mesh.renderOrder = -999;
    this.mesh.raycast = () => undefined;
  }

  /** Moves the haze to the camera; call it before the scene is drawn with a camera. */
  update(camera: Camera): void {
    const far = SKY_DISTANCE * this.distance;
    const matrix = this.mesh.matrix.extractRotation(this.plane.matrixWorld);
    this.#normal.setFromMatrixColumn(matrix, 2);
    const eye = this.#offset.setFromMatrixPosition(camera.matrixWorld);
    const height = eye.clone().sub(new Vector3().setFromMatrixPosition(this.plane.matrixWorld)).dot(this.#normal);
    this.mesh.visible = this.plane.visible && height > 0;
    matrix.scale(new Vector3(far, far, height));
    matrix.setPosition(eye.addScaledVector(this.#normal, -height));
    this.mesh.matrixWorldNeedsUpdate = true;
  }

  dispose(): void {
    this.mesh.geometry.dispose();
    this.mesh.material.dispose();
  }
}

/** A cone around the camera that widens from the plane up to the horizon, opaque in between. */
function hazeGeometry(fraction: number, [red = 1, green = 1, blue = 1]: readonly number[]): BufferGeometry {
  const alpha = Math.atan2(1, fraction);
  const middle = (Math.SQRT1_2 * fraction * Math.sin(alpha)) / Math.sin(0.75 * Math.PI - alpha);
  const positions: number[] = [];
  const colors: number[] = [];
  const indices: number[] = [];
  for (const [height, opacity] of [
    [0, 0],
    [middle, 1],
    [1, 0],
  ] as const) {
    for (let slice = 0; slice < SLICES; slice += 1) {
      const angle = (2 * Math.PI * slice) / SLICES;
      const radius = 1 - fraction * (1 - height);
      positions.push(radius * Math.cos(angle), radius * Math.sin(angle), height);
      colors.push(red, green, blue, opacity);
    }
  }
  for (let row = 0; row < 2; row += 1) {
    for (let slice = 0; slice < SLICES; slice += 1) {
      const next = (slice + 1) % SLICES;
      const [a, b] = [row * SLICES + slice, row * SLICES + next];
      indices.push(a, b, b + SLICES, a, b + SLICES, a + SLICES);
    }
  }
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(new Float32Array(positions), 3));
  geometry.setAttribute("color", new BufferAttribute(new Float32Array(colors), 4));
  geometry.setIndex(indices);
  return geometry;
}
