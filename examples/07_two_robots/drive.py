"""Drives two robots through one connection. Each robot has its own server.

Usage: python drive.py      (connects to MJPLUG_CONNECT, by default to tcp/127.0.0.1:7447)
"""

import math
import statistics
import sys

from mjplug.client import TimedOutError, connect
from mjplug_schemas.geometry_msgs import Twist, Vector3

SPEEDS = {"red": 1.0, "blue": 0.5}

with connect() as client:
    try:
        for robot in SPEEDS:
            client.wait_for(f"/{robot}/cmd_vel")
    except TimedOutError as error:
        sys.exit(f"{error}; start both servers: mjplug serve config.yaml --set namespace=red, and the same with blue")
    print("servers:", ", ".join(sorted(client.nodes())))
    shared = {name for name, topic in client.topics().items() if len(topic.publishers) > 1}
    print("published by both:", ", ".join(sorted(shared)))

    # Both robots publish on this topic; their frames have different prefixes.
    transforms = client.subscribe("/tf", depth=1000)
    odometry = {robot: client.subscribe(f"/{robot}/odom", depth=1000) for robot in SPEEDS}
    scans = {robot: client.subscribe(f"/{robot}/scan") for robot in SPEEDS}
    wheels = {robot: client.publisher(f"/{robot}/cmd_vel", Twist) for robot in SPEEDS}
    path = {robot: [] for robot in SPEEDS}
    for _ in range(10):
        for robot, speed in SPEEDS.items():
            wheels[robot].publish(Twist(linear=Vector3(x=speed)))
            path[robot] += [odometry[robot].next(timeout=10.0) for _ in range(10)]

    for robot, messages in path.items():
        # Each server has its own simulated time, so the stamps of one robot are compared with each other only.
        times = [message.header.stamp.to_ns() / 1e9 for message in messages]
        places = [message.pose.pose.position.x for message in messages]
        speeds = [(places[i + 1] - places[i]) / (times[i + 1] - times[i]) for i in range(len(messages) - 1)]
        scan = scans[robot].next(timeout=20.0)
        nearest = min(scan.ranges)
        # The median, because a robot stands until its first command arrives.
        print(f"{robot} drives at {statistics.median(speeds):.3f} m/s in {messages[-1].header.frame_id}; ", end="")
        print(f"{scan.header.frame_id} sees {'something' if math.isfinite(nearest) else 'nothing'}")

    links = {}
    while not all(f"{robot}/base_link" in links for robot in SPEEDS):
        for transform in transforms.next(timeout=10.0).transforms:
            links[transform.child_frame_id] = transform.header.frame_id
    for robot in SPEEDS:
        print(f"/tf: {links[f'{robot}/base_link']} -> {robot}/base_link")
