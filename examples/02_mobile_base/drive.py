"""Drives a circle, then stops sending commands.

Usage: python drive.py      (connects to MJPLUG_CONNECT, by default to tcp/127.0.0.1:7447)
"""

import math

from mjplug.client import connect
from mjplug_schemas.geometry_msgs import Twist, Vector3

with connect() as client:
    cmd_vel = client.publisher("/cmd_vel", Twist)
    states = client.subscribe("/base/free_joint_states", depth=1000)

    def watch(count):
        """Returns the position of the base in the next `count` messages; there are 100 messages per second."""
        return [states.next(timeout=5.0).free_joints[0].pose.pose.position for _ in range(count)]

    circle = []
    # A command holds for 0.5 s, so it is repeated every 0.1 s, as a joystick does.
    for _ in range(15):
        cmd_vel.publish(Twist(linear=Vector3(x=0.8), angular=Vector3(z=1.6)))
        circle += watch(10)
    *_, before, last = watch(70)

radii = [math.hypot(point.x, point.y - 0.5) for point in circle]
print(f"drove a circle of radius {min(radii):.3f} to {max(radii):.3f} m around (0, 0.5), by "
      f"{math.degrees(math.atan2(circle[-1].x, 0.5 - circle[-1].y)):.0f} degrees")  # fmt: skip
print("stood still" if math.dist((before.x, before.y), (last.x, last.y)) < 1e-6 else "kept rolling", "in the end")
