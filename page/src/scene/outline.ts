import {
  Box3,
  type Camera,
  Color,
  DoubleSide,
  Mesh,
  MeshBasicMaterial,
  OrthographicCamera,
  PlaneGeometry,
  type Scene,
  ShaderMaterial,
  Vector2,
  Vector3,
  Vector4,
  type WebGLRenderer,
  WebGLRenderTarget,
} from "three";
import type { Part } from "./part.ts";
import type { World } from "./world.ts";

/** Layer of the objects that are outlined. */
const LAYER = 31;

/** Width of the line and of the dark border that makes it visible on bright backgrounds [px]. */
const WIDTH = 2;
const BORDER = 3.5;

/** Draws a line around bodies, also where other objects hide them. */
export class Outline {
  readonly #mask: WebGLRenderTarget;
  readonly #white = new MeshBasicMaterial({ color: 0xffffff, side: DoubleSide });
  readonly #screen: Mesh<PlaneGeometry, ShaderMaterial>;
  readonly #camera = new OrthographicCamera(-1, 1, 1, -1, 0, 1);
  readonly #size = new Vector2();

  constructor(readonly renderer: WebGLRenderer) {
    this.#mask = new WebGLRenderTarget(1, 1, { depthBuffer: false, generateMipmaps: false });
    const material = new ShaderMaterial({
      vertexShader: VERTEX,
      fragmentShader: FRAGMENT,
      transparent: true,
      depthTest: false,
      depthWrite: false,
      uniforms: {
        mask: { value: this.#mask.texture },
        step: { value: new Vector2() },
        ratio: { value: 1 },
        color: { value: new Color("#ff9d1f") },
      },
    });
    this.#screen = new Mesh(new PlaneGeometry(2, 2), material);
    this.#screen.frustumCulled = false;
  }

  /** Adds the outlines to the picture; call it after the scene was drawn. */
  draw(scene: Scene, worlds: readonly World[], camera: Camera): void {
    const parts = worlds.flatMap((world) => outlinedParts(world));
    const { renderer } = this;
    const ratio = renderer.getPixelRatio();
    const { x: width, y: height } = renderer.getDrawingBufferSize(this.#size);
    const margin = Math.ceil((BORDER + 1) * ratio);
    const area = this.#area(parts, camera, margin);
    // For each pixel of the area, the mask is read around it, so more than the area must be cleared of older masks.
    const cleared = this.#area(parts, camera, 2 * margin);
    if (area === null || cleared === null) return;
    const { autoClear } = renderer;
    if (this.#mask.width !== width || this.#mask.height !== height) this.#mask.setSize(width, height);
    const layers = camera.layers.mask;
    const visible = scene.overrideMaterial;
    for (const { mesh } of parts) mesh.layers.enable(LAYER);
    camera.layers.set(LAYER);
    scene.overrideMaterial = this.#white;
    const shadows = renderer.shadowMap.autoUpdate;
    renderer.shadowMap.autoUpdate = false;
    this.#mask.scissorTest = true;
    this.#mask.scissor.copy(cleared);
    renderer.autoClear = true;
    renderer.setRenderTarget(this.#mask);
    renderer.render(scene, camera);
    renderer.setRenderTarget(null);
    scene.overrideMaterial = visible;
    camera.layers.mask = layers;
    for (const { mesh } of parts) mesh.layers.disable(LAYER);
    const { uniforms } = this.#screen.material;
    uniforms["step"]!.value.set(1 / width, 1 / height);
    uniforms["ratio"]!.value = ratio;
    renderer.autoClear = false;
    renderer.setScissorTest(true);
    renderer.setScissor(area.x / ratio, area.y / ratio, area.z / ratio, area.w / ratio);
    renderer.render(this.#screen as unknown as Scene, this.#camera);
    renderer.setScissorTest(false);
    renderer.autoClear = autoClear;
    renderer.shadowMap.autoUpdate = shadows;
  }

  /** Returns the part of the picture that contains the parts and a margin [px of the graphics card], or null. */
  #area(parts: readonly Part[], camera: Camera, margin: number): Vector4 | null {
    const { x: width, y: height } = this.renderer.getDrawingBufferSize(this.#size);
    const box = new Box3();
    for (const { mesh } of parts) box.expandByObject(mesh);
    if (box.isEmpty()) return null;
    const low = new Vector2(Infinity, Infinity);
    const high = new Vector2(-Infinity, -Infinity);
    const corner = new Vector3();
    for (let bits = 0; bits < 8; bits += 1) {
      corner.set(bits & 1 ? box.max.x : box.min.x, bits & 2 ? box.max.y : box.min.y, bits & 4 ? box.max.z : box.min.z);
      corner.applyMatrix4(camera.matrixWorldInverse);
      if (corner.z > -1e-6) return new Vector4(0, 0, width, height);
      corner.applyMatrix4(camera.projectionMatrix);
      const place = new Vector2(((1 + corner.x) / 2) * width, ((1 + corner.y) / 2) * height);
      low.min(place);
      high.max(place);
    }
    low.subScalar(margin).floor().max(new Vector2(0, 0));
    high.addScalar(margin).ceil().min(new Vector2(width, height));
    return high.x > low.x && high.y > low.y ? new Vector4(low.x, low.y, high.x - low.x, high.y - low.y) : null;
  }
}

function outlinedParts({ parts, outlined, root }: World): Part[] {
  if (outlined === null || !root.visible) return [];
  // Planes, flexes and skins have no bounds and would fill the picture.
  return parts.filter(
    ({ mesh, body, kind }) => kind === "geom" && body === outlined && mesh.visible && mesh.frustumCulled,
  );
}

const VERTEX = `
varying vec2 place;
void main() {
  place = uv;
  gl_Position = vec4(position.xy, 0.0, 1.0);
}`;

const FRAGMENT = `
varying vec2 place;
uniform sampler2D mask;
uniform vec2 step;
uniform float ratio;
uniform vec3 color;
float around(float radius) {
  float found = 0.0;
  for (int i = 0; i < 12; i++) {
    float angle = float(i) * 0.5235988;
    found = max(found, texture2D(mask, place + radius * ratio * step * vec2(cos(angle), sin(angle))).r);
  }
  return found;
}
void main() {
  float inside = texture2D(mask, place).r;
  float line = around(${WIDTH.toFixed(1)});
  float border = around(${BORDER.toFixed(1)});
  if (inside > 0.5 || border < 0.01) discard;
  gl_FragColor = line > 0.5 ? vec4(color, 1.0) : vec4(0.0, 0.0, 0.0, 0.45 * border);
}`;
