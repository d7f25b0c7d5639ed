"""Time that publishing the states of 100 free bodies takes on the physics thread."""

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
"""Pause after a burst [s], not measured: waiting for a full queue would measure the network."""

TOPIC = "/free_joint_states"


def results() -> list[Result]:
    """Measures the plugin with kinematics, without network and with one subscriber in another process."""
    what = f"publish the states of {BODIES} free bodies"
    alone, _ = _start(OfflineTransport())
    results = [figure(f"{what}, up to the wire", alone, "<= 10", "{:.2f} µs")]
    with network() as opened:
        publish, publisher = _start(opened)
        with listening(opened.session.endpoint, TOPIC.removeprefix("/"), publisher):
            return [*results, figure(f"{what}, one subscriber", publish, "<= 10", "{:.2f} µs")]


def _start(transport: Transport) -> tuple[Callable[[], float], Publisher[Any]]:
    """Starts the plugin; returns a function that measures one message [µs], and its publisher."""
    bodies = "".join(f'<body name="body_{i}" pos="{i} 0 1"><freejoint/><geom size=".1"/></body>' for i in range(BODIES))
    simulation = Simulation(mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{bodies}</worldbody></mujoco>"))
    simulation.data.qvel[:] = np.random.default_rng(0).normal(size=simulation.model.nv)
    host = TimedHost(
        "free_joints",
        Loop(simulation),
        transport,
        lambda name: name.replace("{ns}", ""),
        OfflineWorkerPool(),
        Diagnostics(),
    )
    FreeJointStatePublisher().init(host, FreeJointStatePublisherParameters(topic=TOPIC, publish_rate=1000.0))

    def publish() -> float:
        # Every message is timed separately, so that other activity on the machine does not change the median.
        durations = []
        for k in range(BURSTS * BURST):
            if k % BURST == 0:
                sleep(PAUSE)
            # As after a step.
            simulation.mark_poses_outdated()
            began = perf_counter()
            host.callback()
            durations.append(perf_counter() - began)
        return float(np.median(durations)) * 1e6

    return publish, host.publisher
