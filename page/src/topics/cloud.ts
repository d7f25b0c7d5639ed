import type { Header } from "./messages.ts";
import type { Points } from "./scan.ts";

export interface PointField {
  readonly name: string;
  readonly offset: number;
  /** One of the numbers of sensor_msgs/PointField. */
  readonly datatype: number;
  readonly count: number;
}

export interface PointCloud2 {
  readonly header: Header;
  readonly height: number;
  readonly width: number;
  readonly fields: readonly PointField[];
  readonly is_bigendian: boolean;
  readonly point_step: number;
  readonly row_step: number;
  readonly data: Uint8Array;
}

type Read = (view: DataView, at: number, little: boolean) => number;

/** How to read each data type of sensor_msgs/PointField, and its size [bytes]. */
const TYPES: Readonly<Record<number, readonly [size: number, read: Read]>> = {
  1: [1, (view, at) => view.getInt8(at)],
  2: [1, (view, at) => view.getUint8(at)],
  3: [2, (view, at, little) => view.getInt16(at, little)],
  4: [2, (view, at, little) => view.getUint16(at, little)],
  5: [4, (view, at, little) => view.getInt32(at, little)],
  6: [4, (view, at, little) => view.getUint32(at, little)],
  7: [4, (view, at, little) => view.getFloat32(at, little)],
  8: [8, (view, at, little) => view.getFloat64(at, little)],
};
const COLOURS = new Set(["rgb", "rgba"]);

/** Returns the names of the fields that can colour the points. */
export function valueFields(cloud: PointCloud2): string[] {
  return cloud.fields.map(({ name }) => name).filter((name) => !["x", "y", "z"].includes(name) && !COLOURS.has(name));
}

/**
 * Returns the points of a cloud; points with NaN or infinity are left out.
 *
 * @param most - Maximum number of points; of a larger cloud, every second, third … point is used.
 * @param value - Field whose values are returned, if the cloud has it.
 * @throws Error if the cloud has no coordinates, or if its sizes do not fit its data.
 */
export function cloudPoints(cloud: PointCloud2, most: number, value = "intensity"): Points {
  const little = !cloud.is_bigendian;
  const view = new DataView(cloud.data.buffer, cloud.data.byteOffset, cloud.data.byteLength);
  const reader = (name: string) => {
    const field = cloud.fields.find((candidate) => candidate.name === name);
    if (field === undefined) return null;
    const type = TYPES[field.datatype];
    if (type === undefined || field.offset + type[0] > cloud.point_step) {
      throw new Error(
        `The field ${name} of the cloud has data type ${field.datatype} at ${field.offset}, which is invalid.`,
      );
    }
    const { offset } = field;
    const [, read] = type;
    return (at: number) => read(view, at + offset, little);
  };
  const [x, y, z] = [reader("x"), reader("y"), reader("z")];
  if (x === null || y === null || z === null) {
    throw new Error("The cloud has no fields x, y and z.");
  }
  const total = cloud.width * cloud.height;
  if (total > 0 && (cloud.height - 1) * cloud.row_step + cloud.width * cloud.point_step > view.byteLength) {
    throw new Error(`The cloud has ${view.byteLength} bytes, which is less than its ${total} points need.`);
  }
  const step = Math.max(1, Math.ceil(total / most));
  const room = Math.ceil(total / step);
  const positions = new Float32Array(3 * room);
  const read = reader(value);
  const values = read === null ? null : new Float32Array(room);
  const packed = cloud.fields.find(({ name, datatype }) => COLOURS.has(name) && (datatype === 7 || datatype === 6));
  const colours = packed === undefined ? null : new Uint8Array(3 * room);
  let count = 0;
  for (let index = 0; index < total; index += step) {
    const row = Math.floor(index / cloud.width);
    const at = row * cloud.row_step + (index - row * cloud.width) * cloud.point_step;
    const [px, py, pz] = [x(at), y(at), z(at)];
    if (!Number.isFinite(px + py + pz)) continue;
    positions.set([px, py, pz], 3 * count);
    if (values !== null) values[count] = read!(at);
    if (colours !== null) {
      // Red, green and blue are the lower bytes of a 32-bit number, which is often declared as a float.
      const bits = view.getUint32(at + packed!.offset, little);
      colours.set([(bits >> 16) & 255, (bits >> 8) & 255, bits & 255], 3 * count);
    }
    count += 1;
  }
  return {
    positions: positions.slice(0, 3 * count),
    values: values?.slice(0, count) ?? null,
    colours: colours?.slice(0, 3 * count) ?? null,
    total,
  };
}
