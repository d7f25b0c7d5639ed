/** Bit of `flags`: the simulation is paused. */
const PAUSED = 1;
const HEADER = 36;

/** A frame as in docs/wire.md: the poses of one state, in the world frame [m], quaternions with w first. */
export interface Frame {
  /** Simulated time [s]. */
  readonly time: number;
  /** Wall time [s since 1970]. */
  readonly wallTime: number;
  /** Number of resets. */
  readonly epoch: number;
  /** Number of steps, lowest 32 bits. */
  readonly step: number;
  readonly paused: boolean;
  /** 7 numbers for each moving body: position, quaternion. */
  readonly bodies: Float32Array;
  /** 12 numbers for each camera: position, rotation matrix row by row. */
  readonly cameras: Float32Array;
  /** 3 numbers for each vertex of a flex. */
  readonly vertices: Float32Array;
}

/** Reads the bytes of `@view/frame`. */
export function readFrame(payload: DataView<ArrayBuffer>): Frame {
  const bodies = 7 * payload.getUint16(26, true);
  const cameras = 12 * payload.getUint16(28, true);
  const vertices = 3 * payload.getUint32(32, true);
  const start = payload.byteOffset + HEADER;
  return {
    time: payload.getFloat64(0, true),
    wallTime: payload.getFloat64(8, true),
    epoch: payload.getUint32(16, true),
    step: payload.getUint32(20, true),
    paused: (payload.getUint16(24, true) & PAUSED) !== 0,
    bodies: new Float32Array(payload.buffer, start, bodies),
    cameras: new Float32Array(payload.buffer, start + 4 * bodies, cameras),
    vertices: new Float32Array(payload.buffer, start + 4 * (bodies + cameras), vertices),
  };
}
