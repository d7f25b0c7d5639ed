"""What publishing a 30-joint JointState from a prebuilt frame costs the physics thread."""

import threading
from time import perf_counter

import numpy as np

from benchmarks.measure import Result, figure
from benchmarks.world import client, network
from mjplug.frame import CdrFrame
from mjplug.transport import QoS, Topic
from mjplug_schemas.sensor_msgs import JointState

JOINTS, MESSAGES = 30, 2000


def results() -> list[Result]:
    """With one subscriber in another session; the writes, the stamp and the put are all counted."""
    message = JointState(
        name=[f"joint_{i}" for i in range(JOINTS)],
        position=[0.0] * JOINTS,
        velocity=[0.0] * JOINTS,
        effort=[0.0] * JOINTS,
    )
    state = [np.random.default_rng(i).normal(size=JOINTS + 7) for i in range(3)]
    qpos, qvel, force = (array[7:] for array in state)
    frame = CdrFrame(message)
    position, velocity, effort = (frame.view(part) for part in ("position", "velocity", "effort"))
    with network() as opened, client(opened.session.endpoint) as session:
        matched = threading.Event()
        publisher = opened.open_publisher(Topic("/joint_states", JointState, QoS()), matched.set)
        received = threading.Event()
        session.declare_subscriber("joint_states", lambda _: received.set())
        assert matched.wait(5)

        def publish() -> float:
            began = perf_counter()
            for k in range(MESSAGES):
                position[:] = qpos
                velocity[:] = qvel
                effort[:] = force
                frame.set_stamp("header.stamp", k * 2_000_000)
                publisher.publish_frame(frame)
            elapsed = perf_counter() - began
            return elapsed / MESSAGES * 1e6

        result = figure("publish a 30-joint JointState from a frame, with its writes, one subscriber [µs]", publish, "<= 5", "{:.2f} µs")
        assert received.wait(5)
        return [result]
