import { type BufferGeometry, DoubleSide, FrontSide, MeshPhongMaterial, type Texture } from "three";
import type { LightUniforms } from "./lights.ts";

/** What a surface looks like, in MuJoCo's terms. */
export interface Look {
  /** Red, green, blue, alpha from 0 to 1. */
  readonly rgba: readonly [number, number, number, number];
  readonly emission: number;
  readonly specular: number;
  readonly shininess: number;
}

export interface ShadingOptions {
  readonly map?: Texture | null;
  readonly cube?: Texture | null;
  /** Each triangle has one normal, which the shader computes. */
  readonly flat?: boolean;
  readonly doubleSided?: boolean;
  /** Each instance has a colour: the attribute `rgba`. */
  readonly instanceColors?: boolean;
  /** Each instance has a length: the attribute `stretch` moves vertices by `end` along z. */
  readonly stretch?: boolean;
}

/** From this alpha on, MuJoCo draws a shape as opaque. */
const OPAQUE = 0.995;

/** Below this exponent pow(0, exponent) is undefined in GLSL. */
const MIN_EXPONENT = 1e-4;

/**
 * A material with the lighting of MuJoCo's renderer, which is that of OpenGL's fixed functions, computed for each pixel:
 * emission, and for each light ambient, diffuse and specular parts; the sum is clamped and then multiplied by the texture.
 */
export class Shading extends MeshPhongMaterial {
  readonly #variant: string;
  readonly #alpha: number;

  constructor(look: Look, lights: LightUniforms, options: ShadingOptions = {}) {
    super({
      map: options.map ?? null,
      flatShading: options.flat ?? false,
      side: options.doubleSided === true ? DoubleSide : FrontSide,
    });
    // Otherwise three.js draws both sides one after the other, and turns the normals of one of them.
    this.forceSinglePass = true;
    const [red, green, blue, alpha] = look.rgba;
    this.color.setRGB(red, green, blue);
    this.#alpha = alpha;
    this.setAlpha(alpha);
    const { cube, instanceColors = false, stretch = false } = options;
    const defines: Record<string, string> = { MJ_LIGHTS: String(lights.count) };
    if (cube != null) defines["MJ_CUBE"] = "";
    if (instanceColors) defines["MJ_INSTANCE_COLORS"] = "";
    if (stretch) defines["MJ_STRETCH"] = "";
    this.defines = { ...this.defines, ...defines };
    this.#variant = JSON.stringify(defines);
    this.onBeforeCompile = (shader) => {
      Object.assign(shader.uniforms, lights.uniforms, {
        mjEmission: { value: look.emission },
        mjSpecular: { value: look.specular },
        mjShininess: { value: Math.max(MIN_EXPONENT, 128 * look.shininess) },
        mjCube: { value: cube ?? null },
      });
      shader.vertexShader = shader.vertexShader
        .replace("#include <common>", `#include <common>\n${VERTEX_DECLARATIONS}`)
        .replace("#include <begin_vertex>", `#include <begin_vertex>\n${VERTEX}`);
      shader.fragmentShader = shader.fragmentShader
        .replace("#include <common>", `#include <common>\n${FRAGMENT_DECLARATIONS}`)
        .replace("#include <lights_phong_fragment>", "")
        .replace("#include <lights_fragment_begin>", FRAGMENT)
        .replace("#include <lights_fragment_maps>", "")
        .replace("#include <lights_fragment_end>", "");
    };
  }

  override customProgramCacheKey(): string {
    return this.#variant;
  }

  /** Multiplies the alpha of the look. */
  fade(factor: number): void {
    this.setAlpha(this.#alpha * factor);
  }

  /** Draws the surface with an alpha; below 0.995 it does not hide what is behind it. */
  setAlpha(alpha: number): void {
    const transparent = alpha < OPAQUE;
    // MuJoCo draws transparent shapes twice.
    this.opacity = transparent ? 1 - (1 - alpha) ** 2 : 1;
    if (transparent !== this.transparent) {
      this.transparent = transparent;
      this.depthWrite = !transparent;
      this.needsUpdate = true;
    }
  }
}

/** A geometry that is drawn with a cube texture needs this attribute: the direction into the texture. */
export function isCubeMapped(geometry: BufferGeometry): boolean {
  return geometry.hasAttribute("direction");
}

const VERTEX_DECLARATIONS = `
#ifdef MJ_CUBE
attribute vec3 direction;
varying vec3 mjDirection;
#endif
#ifdef MJ_INSTANCE_COLORS
attribute vec4 rgba;
varying vec4 mjRgba;
#endif
#ifdef MJ_STRETCH
attribute float end;
attribute float stretch;
#endif
`;

const VERTEX = `
#ifdef MJ_CUBE
mjDirection = direction;
#endif
#ifdef MJ_INSTANCE_COLORS
mjRgba = rgba;
#endif
#ifdef MJ_STRETCH
transformed.z += end * stretch;
#endif
`;

const FRAGMENT_DECLARATIONS = `
uniform float mjEmission;
uniform float mjSpecular;
uniform float mjShininess;
uniform vec3 mjGlobalAmbient;
#if MJ_LIGHTS > 0
uniform vec4 mjLightPosition[MJ_LIGHTS];
uniform vec4 mjLightDirection[MJ_LIGHTS];
uniform vec4 mjLightShape[MJ_LIGHTS];
uniform vec3 mjLightAmbient[MJ_LIGHTS];
uniform vec3 mjLightDiffuse[MJ_LIGHTS];
uniform vec3 mjLightSpecular[MJ_LIGHTS];
uniform float mjLightShadow[MJ_LIGHTS];
#endif
#ifdef MJ_CUBE
uniform samplerCube mjCube;
varying vec3 mjDirection;
#endif
#ifdef MJ_INSTANCE_COLORS
varying vec4 mjRgba;
#endif
`;

/**
 * Positions and directions are in the camera's frame. mjLightPosition.w is 0 for a directional light; mjLightDirection.w
 * is the cosine of the cutoff; mjLightShape is the attenuation and the exponent; mjLightShadow is the number of the
 * light's shadow, or -1.
 */
const FRAGMENT = `
vec4 mjColor = vec4(diffuse, opacity);
#ifdef MJ_INSTANCE_COLORS
mjColor *= mjRgba;
#endif
vec3 mjTexel = vec3(1.0);
#ifdef USE_MAP
mjTexel = sampledDiffuseColor.rgb;
#ifndef OPAQUE
mjColor.a *= sampledDiffuseColor.a;
#endif
#endif
#ifdef MJ_CUBE
mjTexel = textureCube(mjCube, mjDirection).rgb;
#endif
#ifdef FLAT_SHADED
vec3 mjNormal = normal;
#else
vec3 mjNormal = normalize(vNormal);
#endif
vec3 mjView = normalize(vViewPosition);
#ifdef USE_SHADOWMAP
float mjShadows[4] = float[4](1.0, 1.0, 1.0, 1.0);
#if NUM_DIR_LIGHT_SHADOWS > 0
#pragma unroll_loop_start
for (int i = 0; i < NUM_DIR_LIGHT_SHADOWS; i++) {
  mjShadows[i] = receiveShadow ? getShadow(directionalShadowMap[i], directionalLightShadows[i].shadowMapSize,
    directionalLightShadows[i].shadowIntensity, directionalLightShadows[i].shadowBias,
    directionalLightShadows[i].shadowRadius, vDirectionalShadowCoord[i]) : 1.0;
}
#pragma unroll_loop_end
#endif
#if NUM_SPOT_LIGHT_SHADOWS > 0
#pragma unroll_loop_start
for (int i = 0; i < NUM_SPOT_LIGHT_SHADOWS; i++) {
  mjShadows[2 + UNROLLED_LOOP_INDEX] = receiveShadow ? getShadow(spotShadowMap[i], spotLightShadows[i].shadowMapSize,
    spotLightShadows[i].shadowIntensity, spotLightShadows[i].shadowBias,
    spotLightShadows[i].shadowRadius, vSpotLightCoord[i]) : 1.0;
}
#pragma unroll_loop_end
#endif
#endif
vec3 mjLit = (mjEmission + mjGlobalAmbient) * mjColor.rgb;
vec3 mjShadowed = vec3(0.0);
#if MJ_LIGHTS > 0
for (int i = 0; i < MJ_LIGHTS; i++) {
  vec3 toLight = -mjLightDirection[i].xyz;
  float strength = 1.0;
  if (mjLightPosition[i].w != 0.0) {
    vec3 offset = mjLightPosition[i].xyz + vViewPosition;
    float far = length(offset);
    toLight = offset / far;
    vec4 form = mjLightShape[i];
    float along = -dot(toLight, mjLightDirection[i].xyz);
    // OpenGL has a hard edge that is blurred between the vertices of a plane.
    float edge = mjLightDirection[i].w;
    strength = edge <= -1.0 ? 1.0 : smoothstep(edge, edge + 0.15 * (1.0 - edge), along);
    strength *= pow(max(along, 1e-6), form.w) / (form.x + far * (form.y + far * form.z));
  }
  float facing = dot(mjNormal, toLight);
  vec3 part = mjLightAmbient[i] * mjColor.rgb;
  if (facing > 0.0) {
    float mirrored = max(0.0, dot(mjNormal, normalize(toLight + mjView)));
    part += facing * mjLightDiffuse[i] * mjColor.rgb + pow(mirrored, mjShininess) * mjSpecular * mjLightSpecular[i];
  }
  part *= strength;
#ifdef USE_SHADOWMAP
  int slot = int(mjLightShadow[i]);
  if (slot >= 0) {
    mjShadowed += min(part, 1.0) * mjShadows[slot];
    continue;
  }
#endif
  mjLit += part;
}
#endif
reflectedLight.directDiffuse = (min(mjLit, 1.0) + mjShadowed) * mjTexel;
totalEmissiveRadiance = vec3(0.0);
diffuseColor.a = mjColor.a;
`;
