"""Drives a figure eight while `mjplug view --record` writes it into figure_eight.html.

Usage: python figure_eight.py      (connects to MJPLUG_CONNECT, by default to tcp/127.0.0.1:7447)
"""

import math
import subprocess
import sys
from pathlib import Path

from mjplug.client import connect
from mjplug.view.built_page import FOLDER
from mjplug_schemas.geometry_msgs import Twist, Vector3

SPEED, TURN = 1.0, 2.0  # m/s and rad/s: two circles with a radius of 0.5 m, each in 3.14 s
RECORDING = Path("figure_eight.html")

if not (FOLDER / "index.html").exists():
    print("left out: the page is not built; run: make page")
    sys.exit()

recorder = subprocess.Popen([sys.executable, "-m", "mjplug", "view", "--record", RECORDING, "--duration", "8"])
with connect() as client:
    cmd_vel = client.publisher("/cmd_vel", Twist)
    odometry = client.subscribe("/odom", depth=1000)

    path = []
    for turn in (TURN, -TURN):
        # The odometry has 50 messages per second of simulated time; a command holds for 0.5 s, so it is repeated.
        for _ in range(round(2 * math.pi / TURN * 10)):
            cmd_vel.publish(Twist(linear=Vector3(x=SPEED), angular=Vector3(z=turn)))
            path += [odometry.next(timeout=5.0).pose.pose.position for _ in range(5)]
    cmd_vel.publish(Twist())

xy = [(point.x, point.y) for point in path]
length = sum(map(math.dist, xy, xy[1:]))
left, right = max(y for _, y in xy), -min(y for _, y in xy)
print(f"drove {length:.1f} m on two circles, {left:.2f} m to the left and {right:.2f} m to the right, "
      f"and ended {math.dist(xy[0], xy[-1]):.1f} m from the start")  # fmt: skip
recorder.wait(60)
print(f"open it in a browser: {RECORDING.resolve()}")
