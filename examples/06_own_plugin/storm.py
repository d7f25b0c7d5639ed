"""Increases the wind in three steps and prints the angle at which the sign comes to rest.

Usage: python storm.py      (connects to MJPLUG_CONNECT, by default to tcp/127.0.0.1:7447)
"""

import math

from mjplug.client import connect

with connect() as client:
    forces = client.subscribe("/wind/force")
    for speed in (4.0, 8.0, 12.0):
        client.publish("/wind/velocity", {"x": speed})
        force = forces.next(timeout=5.0).x
        with client.subscribe("/joint_states", depth=1000) as angles:
            # Four seconds of simulated time.
            settled = [angles.next(timeout=5.0) for _ in range(200)][-1]
        angle = -math.degrees(settled.position[0])
        print(f"{speed:4.1f} m/s: a force of {force:5.2f} N, the sign hangs at {angle:5.2f} degrees")
