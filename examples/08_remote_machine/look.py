"""Lists what a server on another machine provides, and calls its services.

Usage: python look.py ENDPOINT      (such as tcp/10.99.0.1:7447)
"""

import statistics
import sys
import time

from mjplug.client import connect

push = {
    "wrench": {"header": {"frame_id": "base_link"}, "wrench": {"force": {"y": 20.0}}},
    "duration": {"nanosec": 10**8},
}

with connect(sys.argv[1]) as client:
    print(f"{client.server.name} is at {client.endpoint}, with {len(client.topics())} topics")
    print(client.subscribe("/mujoco_heartbeat").next(timeout=5.0).data)
    print(client.call("/external_wrench/apply_wrench", wrenches={"external_wrenches": [push]}).message)
    times = []
    for _ in range(20):
        start = time.perf_counter()
        client.call("~/set_pause", paused=False)
        times.append(time.perf_counter() - start)
    print(f"a call takes {statistics.median(times) * 1000:.1f} ms")
