"""Drives two robots, each in a server of its own, over one connection.

Usage: python race.py      (the first server is where MJPLUG_CONNECT says, else at tcp/127.0.0.1:7447)
"""

from mjplug.client import connect
from mjplug_schemas.geometry_msgs import Twist, Vector3

SPEEDS = {"red": 1.0, "blue": 0.5}

with connect(server="/red/mjplug") as client:
    for robot in SPEEDS:
        client.wait_for(f"/{robot}/base/cmd_vel")
    print("servers:", ", ".join(sorted(client.nodes())))

    poses = {robot: client.subscribe(f"/{robot}/pose/free_joint_states", depth=1000) for robot in SPEEDS}
    wheels = {robot: client.publisher(f"/{robot}/base/cmd_vel", Twist) for robot in SPEEDS}
    path = {robot: [] for robot in SPEEDS}
    for _ in range(10):
        for robot, speed in SPEEDS.items():
            wheels[robot].publish(Twist(linear=Vector3(x=speed)))
            path[robot] += [poses[robot].next(timeout=5.0) for _ in range(10)]

for robot, messages in path.items():
    # Each robot's own time, since each server has one of its own.
    first, last = (message.header.stamp.to_ns() / 1e9 for message in (messages[20], messages[-1]))
    start, end = (message.free_joints[0].pose.pose.position.x for message in (messages[20], messages[-1]))
    print(f"{robot} drives at {(end - start) / (last - first):.3f} m/s")
