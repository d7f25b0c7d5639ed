"""Drives a circle, then lets go.

Usage: python drive.py      (the server is where MJPLUG_CONNECT says, else at tcp/127.0.0.1:7447)
"""

import math

from mjplug.client import connect
from mjplug_schemas.geometry_msgs import Twist, Vector3

with connect() as client:
    cmd_vel = client.publisher("/cmd_vel", Twist)
    states = client.subscribe("/base/free_joint_states", depth=1000)

    def watch(count):
        """Returns where the base is in the next so many messages, 100 of which come in a second."""
        return [states.next(timeout=5.0).free_joints[0].pose.pose.position for _ in range(count)]

    circle = []
    # A command holds for half a second, so it is said again and again, as a joystick would.
    for _ in range(15):
        cmd_vel.publish(Twist(linear=Vector3(x=0.8), angular=Vector3(z=1.6)))
        circle += watch(10)
    *_, before, last = watch(70)

radii = [math.hypot(point.x, point.y - 0.5) for point in circle]
print(f"drove a circle of radius {min(radii):.3f} to {max(radii):.3f} m around (0, 0.5), by "
      f"{math.degrees(math.atan2(circle[-1].x, 0.5 - circle[-1].y)):.0f} degrees")  # fmt: skip
print("stood still" if math.dist((before.x, before.y), (last.x, last.y)) < 1e-6 else "kept rolling", "in the end")
