import type { Info } from "../wire/protocol.ts";

/** A number array in the pack. */
export interface ArrayEntry {
  readonly offset: number;
  readonly type: "f4" | "i1" | "u2" | "u4";
  readonly shape: readonly number[];
}

/** A file in the pack. */
export interface FileEntry {
  readonly offset: number;
  readonly size: number;
}

export type Vector = readonly number[];

export interface BodyEntry {
  readonly name: string;
  readonly parent: number;
  readonly root: number;
  readonly pos: Vector;
  /** w first */
  readonly quat: Vector;
  /** [kg] */
  readonly mass: number;
  readonly mocap: boolean;
}

/** What geoms and sites have in common; the pose is relative to the body. */
export interface ShapeEntry {
  readonly id: number;
  readonly name: string;
  readonly body: number;
  readonly type: string;
  readonly size: Vector;
  readonly pos: Vector;
  readonly quat: Vector;
  readonly rgba: Vector;
  /** Index into `materials`; -1 means none. */
  readonly material: number;
  readonly group: number;
}

export interface GeomEntry extends ShapeEntry {
  readonly mesh?: number;
  readonly hfield?: number;
}

export interface CameraEntry {
  readonly name: string;
  readonly body: number;
  /** [degrees] */
  readonly fovy: number;
  readonly resolution: Vector;
  /** [m]; zeros mean that `fovy` counts. */
  readonly sensorsize: Vector;
  /** Focal length in x and y, principal point in x and y [m]. */
  readonly intrinsic: Vector;
}

export interface LightEntry {
  readonly name: string;
  readonly body: number;
  readonly type: string;
  /** fixed, track, trackcom, targetbody or targetbodycom */
  readonly mode?: string;
  /** The body at which the light looks; -1 means none. */
  readonly target?: number;
  readonly pos: Vector;
  readonly dir: Vector;
  /** Position relative to the body in the model's default position, and direction; both in the world frame. */
  readonly pos0?: Vector;
  readonly dir0?: Vector;
  readonly active: boolean;
  readonly castshadow: boolean;
  readonly attenuation: Vector;
  /** [degrees] */
  readonly cutoff: number;
  readonly exponent: number;
  readonly ambient: Vector;
  readonly diffuse: Vector;
  readonly specular: Vector;
}

export interface MaterialEntry {
  readonly name: string;
  readonly rgba: Vector;
  readonly emission: number;
  readonly specular: number;
  readonly shininess: number;
  readonly reflectance: number;
  /** Index into `textures`; -1 means none. */
  readonly texture: number;
  readonly texrepeat: Vector;
  readonly texuniform: boolean;
}

export interface TextureEntry {
  readonly name: string;
  readonly type: "2d" | "cube" | "skybox";
  readonly width: number;
  readonly height: number;
  /** Whether the graphics card converts the pixels from sRGB to linear values. */
  readonly srgb?: boolean;
  readonly png: FileEntry;
}

export interface MeshEntry {
  readonly id: number;
  readonly positions: ArrayEntry;
  readonly normals: ArrayEntry;
  readonly indices: ArrayEntry;
  readonly uv?: ArrayEntry;
}

export interface HeightFieldEntry {
  readonly id: number;
  /** Half lengths in x and y, height of elevation 1, depth of the base [m]. */
  readonly size: Vector;
  /** Rows from -y to +y, values from 0 to 1. */
  readonly elevation: ArrayEntry;
}

export interface FlexEntry {
  readonly id: number;
  readonly dim: number;
  readonly first_vertex: number;
  readonly vertices: number;
  /** Vertex indices: of the lines (dim 1), of the triangles (dim 2), or of the surface (dim 3). */
  readonly elements: ArrayEntry;
  readonly radius: number;
  readonly rgba: Vector;
  readonly material: number;
  readonly group: number;
  /** Whether each triangle has one normal. */
  readonly flat?: boolean;
  readonly uv?: ArrayEntry;
  /** Indices into `uv`, in the shape of `elements`. */
  readonly uv_elements?: ArrayEntry;
}

export interface BoneEntry {
  readonly body: number;
  readonly pos: Vector;
  readonly quat: Vector;
  readonly vertices: ArrayEntry;
  readonly weights: ArrayEntry;
}

export interface SkinEntry {
  readonly id: number;
  readonly positions: ArrayEntry;
  readonly indices: ArrayEntry;
  readonly inflate: number;
  readonly rgba: Vector;
  readonly material: number;
  readonly group: number;
  readonly bones: readonly BoneEntry[];
  readonly uv?: ArrayEntry;
}

/** The sections of MuJoCo's `visual` that are used. */
export interface Visual {
  readonly global: { readonly fovy: number; readonly azimuth: number; readonly elevation: number };
  readonly headlight: {
    readonly active: number;
    readonly ambient: Vector;
    readonly diffuse: Vector;
    readonly specular: Vector;
  };
  readonly map: {
    readonly znear: number;
    readonly zfar: number;
    readonly alpha: number;
    readonly haze: number;
    readonly shadowclip: number;
    readonly shadowscale: number;
  };
  readonly rgba: { readonly haze: Vector };
}

/** The header of a drawing pack; docs/wire.md describes it, mjplug/services/view/pack.py writes it. */
export interface PackHeader extends Pick<Info, "joints" | "actuators" | "keyframes"> {
  readonly name: string;
  readonly mujoco: string;
  readonly bodies: readonly BodyEntry[];
  /** Ids of the bodies whose poses are in the frames. */
  readonly moving: readonly number[];
  readonly geoms: readonly GeomEntry[];
  readonly sites: readonly ShapeEntry[];
  readonly cameras: readonly CameraEntry[];
  readonly lights: readonly LightEntry[];
  readonly materials: readonly MaterialEntry[];
  readonly textures: readonly TextureEntry[];
  readonly meshes: readonly MeshEntry[];
  readonly hfields: readonly HeightFieldEntry[];
  readonly flexes: readonly FlexEntry[];
  readonly skins: readonly SkinEntry[];
  readonly vis: Visual;
  readonly stat: { readonly center: Vector; readonly extent: number };
}

/** A drawing pack: everything but the poses that is needed to draw a model. */
export class Pack {
  readonly header: PackHeader;
  readonly #start: number;

  /** @throws Error if the buffer is no drawing pack. */
  constructor(readonly buffer: ArrayBuffer) {
    const view = new DataView(buffer);
    const magic = new TextDecoder().decode(new Uint8Array(buffer, 0, Math.min(4, buffer.byteLength)));
    if (magic !== "MJV1") {
      throw new Error(`The model cannot be read: it starts with "${magic}" instead of "MJV1".`);
    }
    const length = view.getUint32(4, true);
    this.header = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 8, length)));
    this.#start = 8 + length + (-(8 + length) & 7);
  }

  /** Returns an array of the pack, without a copy. */
  array(entry: ArrayEntry): Float32Array<ArrayBuffer> | Int8Array | Uint16Array | Uint32Array {
    const Type = { f4: Float32Array, i1: Int8Array, u2: Uint16Array, u4: Uint32Array }[entry.type];
    return new Type(
      this.buffer,
      this.#start + entry.offset,
      entry.shape.reduce((a, b) => a * b, 1),
    );
  }

  /** Returns an array of float32, without a copy. */
  floats(entry: ArrayEntry): Float32Array<ArrayBuffer> {
    return this.array(entry) as Float32Array<ArrayBuffer>;
  }

  /** Returns a file of the pack, such as a PNG image. */
  file(entry: FileEntry): Uint8Array<ArrayBuffer> {
    return new Uint8Array(this.buffer, this.#start + entry.offset, entry.size);
  }
}
