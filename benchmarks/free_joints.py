"""What publishing the states of 100 free bodies costs the physics thread."""

import subprocess
import sys
from collections.abc import Callable
from time import perf_counter, sleep
from typing import Any

import mujoco
import numpy as np

from benchmarks.measure import Result, figure
from benchmarks.world import network
from mjplug.core.loop import Loop
from mjplug.core.scheduler import Timer
from mjplug.core.simulation import Simulation
from mjplug.plugin import Host, Publisher
from mjplug_plugins.free_joint_state_publisher import FreeJointStatePublisher, FreeJointStatePublisherParameters

BODIES, BURST, BURSTS = 100, 50, 40

PAUSE = 0.01
"""Time for a burst to leave [s], not counted: a put that waits for a full queue would measure the network. One
of 50 messages has 760 kB."""

TOPIC = "/free_joint_states"

_SUBSCRIBER = """
import json, sys, zenoh
config = zenoh.Config()
config.insert_json5("mode", '"client"')
config.insert_json5("connect/endpoints", json.dumps([sys.argv[1]]))
with zenoh.open(config) as session:
    session.declare_subscriber(sys.argv[2], lambda sample: None)
    sys.stdin.read()
"""


class _Host(Host):
    """Keeps what the plugin's timer would call, and the publisher it depends on, to time them without the steps."""

    callback: Callable[[], None]
    publisher: Publisher[Any] | None

    def create_timer(
        self, period: float, callback: Callable[[], None], while_matched: Publisher[Any] | None = None
    ) -> Timer:
        self.callback, self.publisher = callback, while_matched
        return super().create_timer(period, callback, while_matched)


def results() -> list[Result]:
    """The whole plugin with one subscriber in another process: kinematics, turning, writing, stamps and put."""
    bodies = "".join(f'<body name="body_{i}" pos="{i} 0 1"><freejoint/><geom size=".1"/></body>' for i in range(BODIES))
    simulation = Simulation(mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{bodies}</worldbody></mujoco>"))
    simulation.data.qvel[:] = np.random.default_rng(0).normal(size=simulation.model.nv)
    with network() as opened:
        host = _Host("free_joints", Loop(simulation), opened, lambda name: name)
        plugin = FreeJointStatePublisher()
        plugin.init(host, FreeJointStatePublisherParameters(topic=TOPIC, publish_rate=1000.0))
        assert host.publisher is not None
        command = [sys.executable, "-c", _SUBSCRIBER, opened.session.endpoint, TOPIC.removeprefix("/")]
        subscriber = subprocess.Popen(command, stdin=subprocess.PIPE)
        try:
            deadline = perf_counter() + 10
            while not host.publisher.matched:
                assert perf_counter() < deadline
                sleep(0.01)

            def publish() -> float:
                # Every message on its own, so that what the machine does besides stays out of the median.
                taken = []
                for k in range(BURSTS * BURST):
                    if k % BURST == 0:
                        sleep(PAUSE)
                    # As after a step.
                    simulation.positions_changed()
                    began = perf_counter()
                    host.callback()
                    taken.append(perf_counter() - began)
                return float(np.median(taken)) * 1e6

            what = f"publish the states of {BODIES} free bodies, kinematics included, one subscriber"
            return [figure(what, publish, "<= 10", "{:.2f} µs")]
        finally:
            subscriber.terminate()
            subscriber.wait(10)
