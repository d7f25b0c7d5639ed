"""Drives two robots through one connection. Each robot has its own server.

Usage: python race.py      (connects to MJPLUG_CONNECT, by default to tcp/127.0.0.1:7447)
"""

import statistics
import sys

from mjplug.client import TimedOutError, connect
from mjplug_schemas.geometry_msgs import Twist, Vector3

SPEEDS = {"red": 1.0, "blue": 0.5}

with connect(server="/red/mjplug") as client:
    try:
        for robot in SPEEDS:
            client.wait_for(f"/{robot}/base/cmd_vel")
    except TimedOutError as error:
        sys.exit(f"{error}; start both servers: mjplug serve config.yaml, mjplug serve config_blue.yaml")
    print("servers:", ", ".join(sorted(client.nodes())))

    poses = {robot: client.subscribe(f"/{robot}/pose/free_joint_states", depth=1000) for robot in SPEEDS}
    wheels = {robot: client.publisher(f"/{robot}/base/cmd_vel", Twist) for robot in SPEEDS}
    path = {robot: [] for robot in SPEEDS}
    for _ in range(10):
        for robot, speed in SPEEDS.items():
            wheels[robot].publish(Twist(linear=Vector3(x=speed)))
            path[robot] += [poses[robot].next(timeout=20.0) for _ in range(10)]

for robot, messages in path.items():
    # Each server has its own simulated time, so the stamps of one robot are compared with each other only.
    times = [message.header.stamp.to_ns() / 1e9 for message in messages]
    places = [message.free_joints[0].pose.pose.position.x for message in messages]
    speeds = [(places[i + 1] - places[i]) / (times[i + 1] - times[i]) for i in range(len(messages) - 1)]
    # The median, because a robot stands until its first command arrives.
    print(f"{robot} drives at {statistics.median(speeds):.3f} m/s")
