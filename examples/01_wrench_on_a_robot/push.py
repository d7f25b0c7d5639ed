"""Pushes the quadruped sideways and prints how its trunk moves.

Usage: python push.py      (connects to MJPLUG_CONNECT, by default to tcp/127.0.0.1:7447)
"""

from mjplug.client import connect

push = {
    "wrench": {"header": {"frame_id": "base_link"}, "wrench": {"force": {"y": 60.0}}},
    "duration": {"nanosec": 400_000_000},
    "ramp_down_duration": {"nanosec": 100_000_000},
}

with connect() as client:
    states = client.subscribe("/trunk/free_joint_states", depth=1000)
    start = states.next(timeout=5.0).free_joints[0].pose.pose.position
    print(client.call("/external_wrench/apply_wrench", wrenches={"external_wrenches": [push]}).message)
    seen = [states.next(timeout=5.0).free_joints[0] for _ in range(140)]

sway = [(state.pose.pose.position.y - start.y) * 1000 for state in seen]
speed = max(state.twist.twist.linear.y for state in seen)
print(f"the trunk swayed {max(sway):.0f} mm to the left, at up to {speed:.2f} m/s, and came back to {sway[-1]:+.0f} mm")
print("it stands" if abs(seen[-1].pose.pose.position.z - start.z) < 0.02 else "it fell")
