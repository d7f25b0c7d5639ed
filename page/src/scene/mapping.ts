import type { MaterialEntry, TextureEntry } from "./pack.ts";
import type { Mapping, Surface, Triple } from "./surface.ts";

/** Returns how a texture is laid onto a shape. */
export function mappingOf(texture: TextureEntry | undefined): Mapping {
  if (texture === undefined) return "none";
  return texture.type === "2d" ? "2d" : "cube";
}

/**
 * Returns a surface with the coordinates of a material's texture, as MuJoCo's renderer computes them.
 *
 * @param size - as `mjvGeom.size`.
 * @param asset - Whether the surface is a mesh or a height field, whose vertices already have their size.
 */
export function mapTexture(
  surface: Surface,
  mapping: Mapping,
  material: MaterialEntry | undefined,
  size: Triple,
  asset: boolean,
): Surface {
  if (material === undefined || mapping === "none") return surface;
  if (mapping === "cube") {
    const directions = surface.directions ?? surface.positions;
    return { ...surface, directions: material.texuniform ? scaled(directions, size) : directions };
  }
  if (surface.uv !== undefined) {
    const scale = repeats(material, size);
    return scale.every((value) => value === 1) ? surface : { ...surface, uv: scaled(surface.uv, scale) };
  }
  return { ...surface, uv: projected(surface.positions, projectionScale(material, size, asset)) };
}

/** Returns how often the texture repeats over coordinates from 0 to 1. */
export function repeats(material: MaterialEntry, size: Triple): readonly [number, number] {
  const repeat = (axis: 0 | 1): number => {
    const own = material.texrepeat[axis]! > 0 ? material.texrepeat[axis]! : 1;
    return material.texuniform && size[axis] > 0 ? own * size[axis] : own;
  };
  return [repeat(0), repeat(1)];
}

function projectionScale(material: MaterialEntry, size: Triple, asset: boolean): readonly [number, number] {
  const scale = (axis: 0 | 1): number => {
    const length = size[axis] > 0 ? size[axis] : 1;
    return (material.texrepeat[axis]! / (asset ? length : 1)) * (material.texuniform ? length : 1);
  };
  return [scale(0), scale(1)];
}

/** Projects a texture along the z axis. */
function projected(positions: Float32Array, [x, y]: readonly [number, number]): Float32Array {
  const uv = new Float32Array((positions.length / 3) * 2);
  for (let vertex = 0; 3 * vertex < positions.length; vertex += 1) {
    uv[2 * vertex] = 0.5 * x * positions[3 * vertex]! - 0.5;
    uv[2 * vertex + 1] = -0.5 * y * positions[3 * vertex + 1]! - 0.5;
  }
  return uv;
}

function scaled(values: Float32Array, factors: readonly number[]): Float32Array {
  return values.map((value, index) => value * factors[index % factors.length]!);
}
