/** The parts of ROS messages that the page shows, as the decoder returns them. */

export interface Time {
  readonly sec: number;
  readonly nanosec: number;
}

export interface Header {
  readonly stamp: Time;
  readonly frame_id: string;
}

export interface Vector3Fields {
  readonly x: number;
  readonly y: number;
  readonly z: number;
}

export interface QuaternionFields extends Vector3Fields {
  readonly w: number;
}

export interface PoseFields {
  readonly position: Vector3Fields;
  readonly orientation: QuaternionFields;
}

export interface TransformStamped {
  readonly header: Header;
  readonly child_frame_id: string;
  readonly transform: { readonly translation: Vector3Fields; readonly rotation: QuaternionFields };
}

export interface PoseStamped {
  readonly header: Header;
  readonly pose: PoseFields;
}

export interface Odometry {
  readonly header: Header;
  readonly child_frame_id: string;
  readonly pose: { readonly pose: PoseFields };
}

export interface Path {
  readonly header: Header;
  readonly poses: readonly PoseStamped[];
}

export interface JointState {
  readonly name: readonly string[];
  readonly position: ArrayLike<number>;
}

/** Returns a time or a duration in s. */
export function seconds({ sec, nanosec }: Time): number {
  return sec + 1e-9 * nanosec;
}

/** Returns the time of a header [s]; null for a zero stamp, which means "the newest". */
export function stampOf(header: Header): number | null {
  const time = seconds(header.stamp);
  return time === 0 ? null : time;
}
