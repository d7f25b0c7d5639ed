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
from mjplug.diagnosis import Diagnostics
from mjplug.offline import OfflineTransport, OfflineWorkers
from mjplug.plugin import Host, Publisher
from mjplug.transport import Transport
from mjplug_plugins.free_joint_state_publisher import FreeJointStatePublisher, FreeJointStatePublisherParameters

BODIES, BURST, BURSTS = 100, 50, 40

PAUSE = 0.01
"""Time for a burst to leave [s], not counted: a put that waits for a full queue would measure the network."""

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
    """What the plugin itself does, kinematics included, and all of it with one subscriber in another process."""
    what = f"publish the states of {BODIES} free bodies"
    alone, _ = _start(OfflineTransport())
    results = [figure(f"{what}, up to the wire", alone, "<= 10", "{:.2f} µs")]
    with network() as opened:
        publish, publisher = _start(opened)
        command = [sys.executable, "-c", _SUBSCRIBER, opened.session.endpoint, TOPIC.removeprefix("/")]
        subscriber = subprocess.Popen(command, stdin=subprocess.PIPE)
        try:
            deadline = perf_counter() + 10
            while not publisher.matched:
                assert perf_counter() < deadline
                sleep(0.01)
            return [*results, figure(f"{what}, one subscriber", publish, "<= 10", "{:.2f} µs")]
        finally:
            subscriber.terminate()
            subscriber.wait(10)


def _start(transport: Transport) -> tuple[Callable[[], float], Publisher[Any]]:
    """Starts the plugin; returns what measures one message [µs], and its publisher."""
    bodies = "".join(f'<body name="body_{i}" pos="{i} 0 1"><freejoint/><geom size=".1"/></body>' for i in range(BODIES))
    simulation = Simulation(mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{bodies}</worldbody></mujoco>"))
    simulation.data.qvel[:] = np.random.default_rng(0).normal(size=simulation.model.nv)
    host = _Host("free_joints", Loop(simulation), transport, lambda name: name, OfflineWorkers(), Diagnostics())
    FreeJointStatePublisher().init(host, FreeJointStatePublisherParameters(topic=TOPIC, publish_rate=1000.0))
    assert host.publisher is not None

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

    return publish, host.publisher
