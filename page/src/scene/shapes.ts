import { type Surface, SurfaceBuilder, type Triple } from "./surface.ts";
import type { Vector } from "./pack.ts";

/** Number of sides of round shapes. */
const SLICES = 32;
const STACKS = 16;

/**
 * Returns the surface of a geom type, in its own frame [m].
 *
 * Texture coordinates and the directions in cube textures are those of MuJoCo's renderer.
 *
 * @param type - sphere, ellipsoid, capsule, cylinder, box, arrow, arrow1 or arrow2.
 * @param size - as `mjvGeom.size`: half lengths in x, y and z; for arrows the radius and twice the length.
 */
export function shape(type: string, size: Triple, slices = SLICES): Surface | null {
  const builder = new SurfaceBuilder();
  if (type === "sphere" || type === "ellipsoid") {
    sphere(builder, size, slices);
  } else if (type === "capsule") {
    cylinder(builder, size, slices);
    halfSphere(builder, size, 1, slices);
    halfSphere(builder, size, -1, slices);
  } else if (type === "cylinder") {
    cylinder(builder, size, slices);
    disk(builder, size, 1, slices);
    disk(builder, size, -1, slices);
  } else if (type === "box") {
    box(builder, size);
  } else if (type === "arrow" || type === "arrow1") {
    const unit = size[2] / 6;
    const shaft: Triple = [size[0], size[1], unit];
    cylinder(builder, shaft, slices, unit);
    disk(builder, shaft, -1, slices, unit);
    cone(builder, type === "arrow" ? 1.75 : 1, size, 2 * unit, unit, slices);
  } else if (type === "arrow2") {
    const unit = size[2] / 3;
    cylinder(builder, [size[0], size[1], unit], slices);
    cone(builder, 1.75, size, unit, unit / 2, slices);
    cone(builder, 1.75, size, -unit, -unit / 2, slices);
  } else {
    return null;
  }
  return builder.build();
}

/** Returns the size of a shape as `mjvGeom.size`, from the size of a geom or site. */
export function sizeOf(type: string, size: Vector): Triple {
  const [x = 0, y = 0, z = 0] = size;
  if (type === "sphere") return [x, x, x];
  if (type === "capsule" || type === "cylinder") return [x, x, y];
  return [x, y, z];
}

/** Returns a vector of length 1 with this direction. */
function normalize(x: number, y: number, z: number): Triple {
  const length = Math.hypot(x, y, z) || 1;
  return [x / length, y / length, z / length];
}

function ring(slices: number, visit: (cos: number, sin: number, fraction: number) => void): void {
  for (let slice = 0; slice <= slices; slice += 1) {
    const angle = (2 * Math.PI * (slice % slices)) / slices;
    visit(Math.cos(angle), Math.sin(angle), slice / slices);
  }
}

function sphere(builder: SurfaceBuilder, [a, b, c]: Triple, slices: number): void {
  const stacks = slices / 2;
  for (let stack = 0; stack <= stacks; stack += 1) {
    const elevation = Math.PI * (stack / stacks - 0.5);
    const radius = Math.cos(elevation);
    const height = Math.sin(elevation);
    ring(slices, (cos, sin, fraction) =>
      builder.vertex(
        [a * radius * cos, b * radius * sin, c * height],
        normalize((radius * cos) / a, (radius * sin) / b, height / c),
        fraction,
        1 - stack / stacks,
        [radius * cos, radius * sin, height],
      ),
    );
  }
  builder.grid(0, stacks + 1, slices + 1);
}

/** The round end of a capsule; `sign` is 1 for the end at +z. */
function halfSphere(builder: SurfaceBuilder, [radius, , half]: Triple, sign: number, slices: number): void {
  const first = builder.count;
  const stacks = Math.max(2, Math.min(STACKS, slices) / 2);
  for (let row = 0; row <= stacks; row += 1) {
    const stack = sign > 0 ? row : stacks - row;
    const elevation = (sign * (Math.PI / 2) * stack) / stacks;
    const flat = Math.cos(elevation);
    const height = Math.sin(elevation);
    ring(slices, (cos, sin, fraction) =>
      builder.vertex(
        [radius * flat * cos, radius * flat * sin, sign * half + radius * height],
        [flat * cos, flat * sin, height],
        fraction,
        sign > 0 ? 1 - stack / stacks : stack / stacks,
        [flat * cos, flat * sin, sign + height],
      ),
    );
  }
  builder.grid(first, stacks + 1, slices + 1);
}

function cylinder(builder: SurfaceBuilder, [a, b, half]: Triple, slices: number, center = 0): void {
  const first = builder.count;
  for (const end of [-1, 1]) {
    ring(slices, (cos, sin, fraction) =>
      builder.vertex([a * cos, b * sin, center + end * half], normalize(cos / a, sin / b, 0), fraction, (1 - end) / 2, [
        cos,
        sin,
        end,
      ]),
    );
  }
  builder.grid(first, 2, slices + 1);
}

function disk(builder: SurfaceBuilder, [a, b, half]: Triple, sign: number, slices: number, center = 0): void {
  const first = builder.count;
  const z = center + sign * half;
  builder.vertex([0, 0, z], [0, 0, sign], 0.5, 0.5, [0, 0, sign]);
  ring(slices, (cos, sin) =>
    builder.vertex([a * cos, b * sin, z], [0, 0, sign], 0.5 + 0.5 * cos, 0.5 + 0.5 * sin, [cos, sin, sign]),
  );
  for (let slice = 1; slice <= slices; slice += 1) {
    const [a1, a2] = sign > 0 ? [slice, slice + 1] : [slice + 1, slice];
    builder.triangle(first, first + a1, first + a2);
  }
}

/** A closed cone whose base is at `base` and whose tip is `height` above it; negative means below. */
function cone(
  builder: SurfaceBuilder,
  widening: number,
  size: Triple,
  base: number,
  height: number,
  slices: number,
): void {
  const [a, b] = [widening * size[0], widening * size[1]];
  const sign = Math.sign(height) || 1;
  const first = builder.count;
  const rows = sign > 0 ? [1, 0] : [0, 1];
  for (const r of rows) {
    ring(slices, (cos, sin, fraction) =>
      builder.vertex(
        [a * r * cos, b * r * sin, base + height * (1 - r)],
        normalize(cos / a, sin / b, 1 / (height || 1)),
        fraction,
        r,
      ),
    );
  }
  builder.grid(first, 2, slices + 1);
  disk(builder, [a, b, 0], -sign, slices, base);
}

function box(builder: SurfaceBuilder, size: Triple): void {
  for (const axis of [0, 1, 2]) {
    for (const sign of [1, -1]) {
      const [s, t] = axis === 0 ? [1, 2] : axis === 1 ? [0, 2] : [0, 1];
      // Whether s, t and the normal are right-handed.
      const forward = axis === 1 ? sign < 0 : sign > 0;
      const first = builder.count;
      for (const y of [-1, 1]) {
        for (const x of [-1, 1]) {
          const unit: [number, number, number] = [0, 0, 0];
          unit[axis] = sign;
          unit[s!] = x;
          unit[t!] = y;
          const normal: [number, number, number] = [0, 0, 0];
          normal[axis] = sign;
          const position: Triple = [unit[0] * size[0], unit[1] * size[1], unit[2] * size[2]];
          builder.vertex(position, normal, (x + 1) / 2, (1 - y) / 2, unit);
        }
      }
      const [a, b, c, d] = forward ? [0, 1, 3, 2] : [0, 2, 3, 1];
      builder.triangle(first + a!, first + b!, first + c!);
      builder.triangle(first + a!, first + c!, first + d!);
    }
  }
}
