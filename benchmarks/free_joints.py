"""What publishing the states of 100 free bodies costs the physics thread."""

from collections.abc import Callable
from time import perf_counter, sleep
from typing import Any

import mujoco
import numpy as np

from benchmarks.listener import listening
from benchmarks.measure import Result, figure
from benchmarks.timed_host import TimedHost
from benchmarks.world import network
from mjplug.contracts.diagnostics import Diagnostics
from mjplug.contracts.transport import Transport
from mjplug.physics.loop import Loop
from mjplug.physics.simulation import Simulation
from mjplug.plugin import Publisher
from mjplug.server.offline import OfflineTransport, OfflineWorkerPool
from mjplug_plugins.free_joint_state_publisher import FreeJointStatePublisher, FreeJointStatePublisherParameters

BODIES, BURST, BURSTS = 100, 50, 40

PAUSE = 0.01
"""Time for a burst to leave [s], not counted: a put that waits for a full queue would measure the network."""

TOPIC = "/free_joint_states"


def results() -> list[Result]:
    """What the plugin itself does, kinematics included, and all of it with one subscriber in another process."""
    what = f"publish the states of {BODIES} free bodies"
    alone, _ = _start(OfflineTransport())
    results = [figure(f"{what}, up to the wire", alone, "<= 10", "{:.2f} µs")]
    with network() as opened:
        publish, publisher = _start(opened)
        with listening(opened.session.endpoint, TOPIC.removeprefix("/"), publisher):
            return [*results, figure(f"{what}, one subscriber", publish, "<= 10", "{:.2f} µs")]


def _start(transport: Transport) -> tuple[Callable[[], float], Publisher[Any]]:
    """Starts the plugin; returns what measures one message [µs], and its publisher."""
    bodies = "".join(f'<body name="body_{i}" pos="{i} 0 1"><freejoint/><geom size=".1"/></body>' for i in range(BODIES))
    simulation = Simulation(mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{bodies}</worldbody></mujoco>"))
    simulation.data.qvel[:] = np.random.default_rng(0).normal(size=simulation.model.nv)
    host = TimedHost("free_joints", Loop(simulation), transport, lambda name: name, OfflineWorkerPool(), Diagnostics())
    FreeJointStatePublisher().init(host, FreeJointStatePublisherParameters(topic=TOPIC, publish_rate=1000.0))

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
