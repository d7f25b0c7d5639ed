"""Drives the server from another process, with nothing but Zenoh and JSON.

Usage: python drive.py [ENDPOINT]      (default tcp/127.0.0.1:7447)
"""

import json
import sys
import threading

import zenoh

config = zenoh.Config()
config.insert_json5("mode", '"client"')
config.insert_json5("connect/endpoints", json.dumps([sys.argv[1] if len(sys.argv) > 1 else "tcp/127.0.0.1:7447"]))

# Ten newtons along x for two seconds, the last half second of them fading out, at the centre of the box.
push = {
    "wrenches": {
        "external_wrenches": [
            {
                "wrench": {"header": {"frame_id": "box"}, "wrench": {"force": {"x": 10.0}}},
                "duration": {"sec": 2},
                "ramp_down_duration": {"nanosec": 500_000_000},
            }
        ]
    }
}


def main() -> int:
    """Listens, pushes, and prints how the box moved; returns 0 if the server said that all went well."""
    with zenoh.open(config) as session:
        beaten, seen = threading.Event(), threading.Event()
        heartbeats: list[str] = []
        latest: dict[str, dict[str, float]] = {}

        def on_heartbeat(sample: zenoh.Sample) -> None:
            heartbeats.append(json.loads(sample.payload.to_bytes())["data"])
            beaten.set()

        def on_pose(sample: zenoh.Sample) -> None:
            latest["position"] = json.loads(sample.payload.to_bytes())["pose"]["position"]
            seen.set()

        session.declare_subscriber("mujoco_heartbeat/@json", on_heartbeat)
        session.declare_subscriber("box_pose/pose/@json", on_pose)
        if not (seen.wait(5.0) and beaten.wait(5.0)):
            print("nothing is published: is the server paused?", file=sys.stderr)
            return 1

        print("heartbeat:", heartbeats[0])
        start = latest["position"]
        print("pushing the box with 10 N along x for 2 s ...", flush=True)
        replies = session.get(
            "external_wrench/apply_wrench",
            payload=json.dumps(push),
            encoding=zenoh.Encoding.APPLICATION_JSON,
            timeout=30.0,
        )
        for reply in replies:
            if reply.ok is None:
                print("refused:", reply.err.payload.to_string(), file=sys.stderr)
                return 1
            answer = json.loads(reply.ok.payload.to_bytes())
            print("answer:", answer)
            moved = {axis: latest["position"][axis] - start[axis] for axis in "xyz"}
            print("the box moved by " + ", ".join(f"{axis} {moved[axis]:+.3f} m" for axis in "xyz"), flush=True)
            return 0 if answer["success"] else 1
    print("no server answers at external_wrench/apply_wrench", file=sys.stderr)
    return 1


if __name__ == "__main__":
    sys.exit(main())
