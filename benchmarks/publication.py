"""Time that publishing a 30-joint JointState from a prepared frame takes on the physics thread."""

from collections.abc import Callable
from time import perf_counter, sleep

import numpy as np
from zenoh import ZBytes

from benchmarks.listener import listening
from benchmarks.measure import Result, figure
from benchmarks.world import network
from mjplug.contracts.cdr_frame import CdrFrame
from mjplug.contracts.transport import QoS, Topic
from mjplug_schemas.sensor_msgs import JointState

JOINTS, BURST, BURSTS = 30, 50, 40

PAUSE = 0.002
"""Pause after a burst [s], not measured: waiting for a full queue would measure the network."""


def results() -> list[Result]:
    """Measures writing the values, the stamp and the put, with one subscriber in another process."""
    zeros = [0.0] * JOINTS
    names = [f"joint_{i}" for i in range(JOINTS)]
    frame = CdrFrame(JointState(name=names, position=zeros, velocity=zeros, effort=zeros))
    position, velocity, effort = (frame.view(part) for part in ("position", "velocity", "effort"))
    # The same layout as in mjData: a free joint, then the joints of the robot.
    qpos, qvel, force = (np.random.default_rng(i).normal(size=JOINTS + 7)[7:] for i in range(3))
    with network() as opened:
        publisher = opened.open_publisher(Topic("/joint_states", JointState, QoS()))
        with listening(opened.session.endpoint, "joint_states", publisher):

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
