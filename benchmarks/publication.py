"""What publishing a 30-joint JointState from a prebuilt frame costs the physics thread."""

import subprocess
import sys
import threading
from collections.abc import Callable
from time import perf_counter, sleep

import numpy as np
from zenoh import ZBytes

from benchmarks.measure import Result, figure
from benchmarks.world import network
from mjplug.frame import CdrFrame
from mjplug.transport import QoS, Topic
from mjplug_schemas.sensor_msgs import JointState

JOINTS, BURST, BURSTS = 30, 50, 40

PAUSE = 0.002
"""Time for a burst to leave [s], not counted: a put that waits for a full queue would measure the network."""

_SUBSCRIBER = """
import json, sys, zenoh
config = zenoh.Config()
config.insert_json5("mode", '"client"')
config.insert_json5("connect/endpoints", json.dumps([sys.argv[1]]))
with zenoh.open(config) as session:
    session.declare_subscriber("joint_states", lambda sample: None)
    sys.stdin.read()
"""


def results() -> list[Result]:
    """With one subscriber in another process; the writes, the stamp and the put are all counted."""
    zeros = [0.0] * JOINTS
    names = [f"joint_{i}" for i in range(JOINTS)]
    frame = CdrFrame(JointState(name=names, position=zeros, velocity=zeros, effort=zeros))
    position, velocity, effort = (frame.view(part) for part in ("position", "velocity", "effort"))
    # As in mjData: a free joint first, then the robot's joints in one piece.
    qpos, qvel, force = (np.random.default_rng(i).normal(size=JOINTS + 7)[7:] for i in range(3))
    with network() as opened:
        matched = threading.Event()
        publisher = opened.open_publisher(Topic("/joint_states", JointState, QoS()), matched.set)
        command = [sys.executable, "-c", _SUBSCRIBER, opened.session.endpoint]
        subscriber = subprocess.Popen(command, stdin=subprocess.PIPE)
        try:
            assert matched.wait(10)

            def burst(send: Callable[[], object]) -> float:
                began = perf_counter()
                for k in range(BURST):
                    position[:] = qpos
                    velocity[:] = qvel
                    effort[:] = force
                    frame.set_stamp("header.stamp", k * 2_000_000)
                    send()
                elapsed = perf_counter() - began
                sleep(PAUSE)
                return elapsed / BURST * 1e6

            def median_burst(send: Callable[[], object]) -> float:
                return float(np.median([burst(send) for _ in range(BURSTS)]))

            what = "publish a 30-joint JointState from a frame, its writes included"
            return [
                figure(
                    f"{what}, up to the wire",
                    lambda: median_burst(lambda: ZBytes(frame.buffer)),
                    "<= 5",
                    "{:.2f} µs",
                ),
                figure(
                    f"{what}, one subscriber",
                    lambda: median_burst(lambda: publisher.publish_frame(frame)),
                    "<= 5",
                    "{:.2f} µs",
                ),
            ]
        finally:
            subscriber.terminate()
            subscriber.wait(10)
