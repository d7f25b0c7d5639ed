import type { Header } from "./messages.ts";

export interface LaserScan {
  readonly header: Header;
  readonly angle_min: number;
  readonly angle_increment: number;
  readonly range_min: number;
  readonly range_max: number;
  readonly ranges: ArrayLike<number>;
  readonly intensities: ArrayLike<number>;
}

/** Points with a value for each, such as an intensity. */
export interface Points {
  /** 3 numbers for each point, in the frame of the message [m]. */
  readonly positions: Float32Array<ArrayBuffer>;
  /** One number for each point; null if the message contains none. */
  readonly values: Float32Array<ArrayBuffer> | null;
  /** 3 bytes for each point; null if the message contains none. */
  readonly colours: Uint8Array<ArrayBuffer> | null;
  /** Number of points in the message, including those that were left out. */
  readonly total: number;
}

/** Returns the points of a scan. Ranges outside the limits, infinite ranges and NaN are left out, as REP 117 defines. */
export function scanPoints(scan: LaserScan): Points {
  const { ranges, intensities, range_min, range_max, angle_min, angle_increment } = scan;
  const positions = new Float32Array(3 * ranges.length);
  const values = intensities.length === ranges.length ? new Float32Array(ranges.length) : null;
  let count = 0;
  for (let ray = 0; ray < ranges.length; ray += 1) {
    const range = ranges[ray]!;
    if (!(range >= range_min && range <= range_max && Number.isFinite(range))) continue;
    const angle = angle_min + ray * angle_increment;
    positions[3 * count] = range * Math.cos(angle);
    positions[3 * count + 1] = range * Math.sin(angle);
    if (values !== null) values[count] = intensities[ray]!;
    count += 1;
  }
  return {
    positions: positions.slice(0, 3 * count),
    values: values?.slice(0, count) ?? null,
    colours: null,
    total: ranges.length,
  };
}
