"""Drives to a goal as Nav2 does: reads /scan, /odom and /tf, and publishes /cmd_vel.

Usage: python navigate.py      (connects to MJPLUG_CONNECT, by default to tcp/127.0.0.1:7447)
"""

import math

from mjplug.client import connect
from mjplug_schemas.geometry_msgs import Twist, Vector3

GOAL = (1.5, 1.0)

with connect() as client:
    for name in ("/scan", "/odom", "/tf", "/tf_static", "/robot_description"):
        client.wait_for(name)
    scan = client.subscribe("/scan").next(timeout=20.0)
    first = round((0.0 - scan.angle_min) / scan.angle_increment)
    print(f"/scan: {len(scan.ranges)} distances in the frame {scan.header.frame_id}; {scan.ranges[first]:.2f} m ahead")

    # A transform leads from each frame to the one above it, up to the odometry's.
    parents = {}
    for topic in ("/tf", "/tf_static"):
        stream = client.subscribe(topic)
        while "base_scan" not in parents or "base_footprint" not in parents:
            parents |= {part.child_frame_id: part.header.frame_id for part in stream.next(timeout=20.0).transforms}
            if topic == "/tf_static" or "base_footprint" in parents:
                break
    chain = ["base_scan"]
    while chain[-1] in parents:
        chain.append(parents[chain[-1]])
    print(f"/tf: {' -> '.join(chain)}")

    odometry = client.subscribe("/odom", depth=1)
    cmd_vel = client.publisher("/cmd_vel", Twist)
    arrived = False
    while not arrived:
        pose = odometry.next(timeout=20.0).pose.pose
        x, y = GOAL[0] - pose.position.x, GOAL[1] - pose.position.y
        heading = 2.0 * math.atan2(pose.orientation.z, pose.orientation.w)
        turn = math.remainder(math.atan2(y, x) - heading, math.tau)
        arrived = math.hypot(x, y) < 0.05
        # Turn first, then drive.
        forward = 0.0 if arrived or abs(turn) > 0.3 else min(0.4, math.hypot(x, y))
        turning = 0.0 if arrived else max(-1.0, min(1.0, 2.0 * turn))
        cmd_vel.publish(Twist(linear=Vector3(x=forward), angular=Vector3(z=turning)))
    print(f"/odom: arrived at ({pose.position.x:.1f}, {pose.position.y:.1f})")
