"""Pushes the box from another process, with Zenoh and JSON only.

Usage: python drive.py [ENDPOINT]      (default tcp/127.0.0.1:7447)
"""

import json
import queue
import sys
from typing import Any

import zenoh

config = zenoh.Config()
config.insert_json5("mode", '"client"')
config.insert_json5("connect/endpoints", json.dumps([sys.argv[1] if len(sys.argv) > 1 else "tcp/127.0.0.1:7447"]))

# 10 N along x at the centre of the box for 2 s. The force fades to zero in the last 0.5 s.
push = {
    "wrench": {"header": {"frame_id": "box"}, "wrench": {"force": {"x": 10.0}}},
    "duration": {"sec": 2},
    "ramp_down_duration": {"nanosec": 500_000_000},
}

PERIOD = 20_000_000
"""Time between two poses [ns]."""


def main() -> None:
    """Pushes the box for 2 s and prints how far it moved in these 2 s of simulated time."""
    with zenoh.open(config) as session:
        heartbeats = subscribe(session, "mujoco_heartbeat")
        poses = subscribe(session, "box_pose/pose")
        print("heartbeat:", heartbeats()["data"])

        # After the reset the box is at rest, and its pose is published every 20 ms: every 10 steps.
        response(send(session, "mjplug/set_pause", paused=True))
        response(send(session, "mjplug/reset_world"))
        reset = nanoseconds(subscribe(session, "clock")()["clock"])
        response(send(session, "mjplug/step_simulation", steps=10))
        before = pose_at(poses, reset + PERIOD)

        # The push begins with the next step, so it ends 2 s after this pose.
        print("pushing the box with 10 N along x for 2 s ...", flush=True)
        pushed = send(session, "external_wrench/apply_wrench", wrenches={"external_wrenches": [push]})
        response(send(session, "mjplug/set_pause", paused=False))
        print("answer:", response(pushed))
        after = pose_at(poses, reset + PERIOD + 2 * 10**9)
        moved = {axis: after[axis] - before[axis] for axis in "xyz"}
        print("the box moved by " + ", ".join(f"{axis} {moved[axis]:+.4f} m" for axis in "xyz"), "in 2 s")


def pose_at(poses: Any, time: int) -> dict[str, float]:
    """Returns the position of the box [m] at a simulated time [ns]; earlier poses are skipped."""
    while nanoseconds((pose := poses())["header"]["stamp"]) < time:
        pass
    if nanoseconds(pose["header"]["stamp"]) != time:
        sys.exit("the pose of this instant did not arrive")
    return pose["pose"]["position"]


def subscribe(session: zenoh.Session, topic: str) -> Any:
    """Subscribes to a topic and returns a function that waits for its next message."""
    samples: queue.Queue[zenoh.Sample] = queue.Queue()
    session.declare_subscriber(f"{topic}/@json", samples.put)

    def next_message() -> dict[str, Any]:
        try:
            return json.loads(samples.get(timeout=10.0).payload.to_bytes())
        except queue.Empty:
            sys.exit(f"no message on {topic} for 10 s: is the server paused?")

    return next_message


def send(session: zenoh.Session, service: str, **request: Any) -> Any:
    """Sends a request and returns its replies, without waiting for them."""
    payload, encoding = json.dumps(request), zenoh.Encoding.APPLICATION_JSON
    return session.get(service, payload=payload, encoding=encoding, timeout=30.0)


def response(replies: Any) -> dict[str, Any]:
    """Waits for the response of a service; ends the program if the request was refused or not answered."""
    for reply in replies:
        if reply.ok is None:
            sys.exit(f"refused: {reply.err.payload.to_string()}")
        answer = json.loads(reply.ok.payload.to_bytes())
        if not answer["success"]:
            sys.exit(f"refused: {answer['message']}")
        return answer
    sys.exit("no server answered")


def nanoseconds(stamp: dict[str, int]) -> int:
    """Returns a stamp in nanoseconds."""
    return stamp["sec"] * 10**9 + stamp["nanosec"]


if __name__ == "__main__":
    main()
