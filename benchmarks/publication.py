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
    qpos, qvel, force = (np.random.default_rng(i).normal(size=JOINTS + 7) for i in range(3))
    qpos_index, dof_index = np.arange(7, 37), np.arange(6, 36)
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
                position[:] = qpos[qpos_index]
                velocity[:] = qvel[dof_index]
                effort[:] = force[dof_index]
                frame.set_stamp("header.stamp", k * 2_000_000)
                publisher.publish_frame(frame)
            elapsed = perf_counter() - began
            return elapsed / MESSAGES * 1e6

        result = figure("publish a 30-joint JointState, one subscriber [µs]", publish, "<= 5", "{:.2f} µs")
        assert received.wait(5)
        return [result]
