import { ColorManagement, LinearSRGBColorSpace, Object3D, PCFShadowMap, WebGLRenderer } from "three";

Object3D.DEFAULT_UP.set(0, 0, 1);
// MuJoCo computes with colours as they are.
ColorManagement.enabled = false;

/** More pixels cost time without being visible. */
const MAX_PIXEL_RATIO = 2;
const MAX_PIXELS = 9e6;

/** Blur at flat angles; 1 is none of it. */
const ANISOTROPY = 8;

/** The graphics card, or what replaces it. */
export interface Graphics {
  readonly renderer: WebGLRenderer;
  /** As the browser reports it. */
  readonly name: string;
  /** Whether the processor draws; then costly effects are off. */
  readonly software: boolean;
  readonly anisotropy: number;
}

/**
 * Returns the graphics card, or null if the browser has no WebGL.
 *
 * @param smooth - Whether to smooth edges even without a graphics card, where that takes as long as everything else.
 */
export function openGraphics(canvas: HTMLCanvasElement, smooth: boolean): Graphics | null {
  const name = rendererName();
  if (name === null) return null;
  const software = isSoftware(name);
  let renderer: WebGLRenderer;
  try {
    renderer = new WebGLRenderer({ canvas, antialias: smooth || !software, powerPreference: "high-performance" });
  } catch {
    return null;
  }
  renderer.outputColorSpace = LinearSRGBColorSpace;
  renderer.info.autoReset = false;
  renderer.shadowMap.enabled = !software;
  renderer.shadowMap.type = PCFShadowMap;
  const anisotropy = software ? 1 : Math.min(ANISOTROPY, renderer.capabilities.getMaxAnisotropy());
  return { renderer, name, software, anisotropy };
}

/** Returns the name of the graphics card. Edges are smoothed or not when a canvas is opened, so another one is asked. */
function rendererName(): string | null {
  const gl = document.createElement("canvas").getContext("webgl2");
  if (gl === null) return null;
  const extension = gl.getExtension("WEBGL_debug_renderer_info");
  const name = String(gl.getParameter(extension?.UNMASKED_RENDERER_WEBGL ?? gl.RENDERER));
  // A browser keeps only few contexts.
  gl.getExtension("WEBGL_lose_context")?.loseContext();
  return name;
}

/** Returns whether a renderer draws with the processor. */
export function isSoftware(name: string): boolean {
  return /swiftshader|llvmpipe|softpipe|software|basic render/i.test(name);
}

/** Returns the number of pixels of the graphics card for each pixel of the page. */
export function pixelRatio(width: number, height: number, ratio: number, software: boolean): number {
  const bounded = Math.min(ratio, software ? 1 : MAX_PIXEL_RATIO);
  return Math.min(bounded, Math.sqrt(MAX_PIXELS / Math.max(1, width * height)));
}
