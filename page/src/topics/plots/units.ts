/** Units of the numbers in ROS messages, by type of the message and path of the field. */

/** The first pattern that matches the path decides; REP 103 defines the units. */
const UNITS: Readonly<Record<string, readonly (readonly [RegExp, string])[]>> = {
  "sensor_msgs/msg/JointState": [
    [/^position/, "rad, m"],
    [/^velocity/, "rad/s, m/s"],
    [/^effort/, "N·m, N"],
  ],
  "sensor_msgs/msg/Imu": [
    [/^angular_velocity\./, "rad/s"],
    [/^linear_acceleration\./, "m/s²"],
  ],
  "sensor_msgs/msg/LaserScan": [
    [/^range/, "m"],
    [/^angle/, "rad"],
  ],
  "sensor_msgs/msg/Range": [[/range/, "m"]],
  "sensor_msgs/msg/MagneticField": [[/^magnetic_field\./, "T"]],
};

const COMMON: readonly (readonly [RegExp, string])[] = [
  [/(^|\.)(sec|stamp\.sec)$/, "s"],
  [/(^|\.)nanosec$/, "ns"],
  [/(^|\.)wrench\.force\.|(^|\.)force\./, "N"],
  [/(^|\.)torque\./, "N·m"],
  [/twist(\.twist)?\.linear\.|^linear\./, "m/s"],
  [/twist(\.twist)?\.angular\.|^angular\./, "rad/s"],
  [/(^|\.)(position|translation|point)\.[xyz]$/, "m"],
];

/** Returns the unit of a field; empty if it is unknown or the number has none. */
export function unitOf(type: string, path: string): string {
  for (const [pattern, unit] of [...(UNITS[type] ?? []), ...COMMON]) if (pattern.test(path)) return unit;
  return "";
}
