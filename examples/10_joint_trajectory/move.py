"""Sends a trajectory of three points and prints the range of motion of each joint.

Usage: python move.py      (connects to MJPLUG_CONNECT, by default to tcp/127.0.0.1:7447)
"""

from mjplug.client import connect

points = [
    {"positions": [0.5, -0.6], "velocities": [0.0, 0.0], "time_from_start": {"nanosec": 600_000_000}},
    {"positions": [0.2, 0.8], "velocities": [0.0, 0.0], "time_from_start": {"sec": 1, "nanosec": 200_000_000}},
    {"positions": [0.0, 0.0], "velocities": [0.0, 0.0], "time_from_start": {"sec": 1, "nanosec": 800_000_000}},
]

with connect() as client:
    states = client.subscribe("/joint_states", depth=1000)
    client.publish("/arm/joint_trajectory", {"joint_names": ["joint1", "joint2"], "points": points})
    # 2 s, with 100 messages per second, from the first message in which a joint moves.
    seen = []
    while len(seen) < 200:
        state = states.next(timeout=20.0)
        if seen or max(abs(speed) for speed in state.velocity) > 0.01:
            seen.append(state)

for joint in ("joint1", "joint2"):
    angles = [state.position[state.name.index(joint)] for state in seen]
    print(f"{joint} went from {min(angles):+.3f} to {max(angles):+.3f} rad, and ends at {angles[-1]:+.3f}")
