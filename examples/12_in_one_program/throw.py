"""Throws a ball at several angles, and measures how far it flies. The server runs inside this program.

Usage: python throw.py
"""

import math
from pathlib import Path

import mjplug

SPEED = 10.0
"""Speed of each throw [m/s]."""

with mjplug.open_server(Path(__file__).with_name("config.yaml"), run=False) as server:
    client = server.client()
    for degrees in range(15, 90, 15):
        angle = math.radians(degrees)
        velocity = {"x": SPEED * math.cos(angle), "z": SPEED * math.sin(angle)}
        client.call("~/reset_world")
        client.call("~/set_free_joint_state", free_joints=[{"name": "ball", "twist": {"twist": {"linear": velocity}}}])
        thrown_at = server.time_ns
        while server.data.qpos[2] >= 0.0:
            server.step()
        seconds = (server.time_ns - thrown_at) / 1e9
        print(f"{degrees} degrees: {server.data.qpos[0]:.3f} m in {seconds:.3f} s")
