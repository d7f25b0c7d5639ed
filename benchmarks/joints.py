"""Time that 30 joints take on the physics thread: state messages at 1 kHz, and PIDs at every step."""

from collections.abc import Callable
from time import perf_counter, sleep
from typing import Any

import mujoco
import numpy as np

from benchmarks.listener import listening
from benchmarks.measure import Result, figure, pairs
from benchmarks.timed_host import TimedHost
from benchmarks.world import network
from mjplug.contracts.diagnostics import Diagnostics
from mjplug.contracts.transport import Transport
from mjplug.physics.loop import Loop
from mjplug.physics.simulation import Simulation
from mjplug.plugin import Publisher
from mjplug.server.offline import OfflineTransport, OfflineWorkerPool
from mjplug_plugins.joints import JointCommands, JointStatePublisher
from mjplug_schemas.builtin_interfaces import Duration
from mjplug_schemas.sensor_msgs import JointState
from mjplug_schemas.trajectory_msgs import JointTrajectory, JointTrajectoryPoint

DAY = Duration(sec=86_400)
"""Duration of the trajectory; longer than any measurement."""

JOINTS, BURST, BURSTS, STEPS = 30, 50, 40, 4000

PAUSE = 0.002
"""Pause after a burst [s], not measured: waiting for a full queue would measure the network."""


class _Transport(OfflineTransport):
    """A transport without subscribers, to which commands are delivered directly."""

    def __init__(self) -> None:
        super().__init__()
        self.deliver: dict[str, Callable[[Any], None]] = {}

    def open_subscription(self, topic: Any, deliver: Callable[[Any], None]) -> None:
        self.deliver[topic.name] = deliver


def results() -> list[Result]:
    """Measures state messages without and with network, and steps with PIDs and unsubscribed states."""
    what = f"JointStatePublisher, {JOINTS} joints"
    alone, _ = _publishing(OfflineTransport())
    rows = [figure(f"{what}: a message, up to the wire", alone, "<= 5", "{:.2f} µs")]
    with network() as opened:
        publish, publisher = _publishing(opened)
        with listening(opened.session.endpoint, "joint_states", publisher):
            rows.append(figure(f"{what}: a message, one subscriber", publish, "<= 5", "{:.2f} µs"))
    unsubscribed, bare = _steps(states=True), _steps()
    rows.append(
        pairs(
            f"{what} at 1 kHz, unsubscribed: a step, against none",
            unsubscribed,
            bare,
            "<= 1.02",
            "{:.2f} µs",
        )
    )
    idle, pid = _steps(commands=True), _steps(commands=True, holding=True)
    rows.append(pairs("JointCommands without PIDs: a step, against none", idle, bare, "<= 1.02", "{:.2f} µs"))
    rows.append(figure(f"JointCommands, {JOINTS} PIDs: added to a step", lambda: pid() - bare(), "<= 20", "{:.2f} µs"))
    moving = _steps(commands=True, moving=True)
    what = f"JointCommands, a trajectory of {JOINTS} PIDs: added to a step"
    rows.append(figure(what, lambda: moving() - pid(), "<= 30", "{:.2f} µs"))
    return rows


def _model() -> mujoco.MjModel:
    bodies, motors = "", ""
    for i in range(JOINTS):
        inertia = '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'
        bodies += f'<body pos="{i} 0 0"><joint name="joint_{i}" axis="0 0 1"/>{inertia}</body>'
        motors += f'<motor joint="joint_{i}"/>'
    xml = f"<mujoco><worldbody>{bodies}</worldbody><actuator>{motors}</actuator></mujoco>"
    model = mujoco.MjModel.from_xml_string(xml)
    model.opt.timestep = 0.001
    return model


def _host(transport: Transport) -> tuple[TimedHost, Loop]:
    loop = Loop(Simulation(_model()))
    return TimedHost(
        "joints",
        loop,
        transport,
        lambda name: f"/{name.removeprefix('{ns}').lstrip('/')}",
        OfflineWorkerPool(),
        Diagnostics(),
    ), loop


def _publishing(transport: Transport) -> tuple[Callable[[], float], Publisher[Any]]:
    """Starts the plugin; returns a function that measures one message [µs], and its publisher."""
    host, _ = _host(transport)
    JointStatePublisher().init(host, JointStatePublisher.parameters_type(rate=1000.0))

    def publish() -> float:
        # Every message is timed separately, so that other activity on the machine does not change the median.
        taken = []
        for k in range(BURSTS * BURST):
            if k % BURST == 0:
                sleep(PAUSE)
            began = perf_counter()
            host.callback()
            taken.append(perf_counter() - began)
        return float(np.median(taken)) * 1e6

    return publish, host.publisher


def _steps(
    states: bool = False, commands: bool = False, holding: bool = False, moving: bool = False
) -> Callable[[], float]:
    """Returns what measures one step of the loop with these plugins [µs]."""
    transport = _Transport()
    host, loop = _host(transport)
    if states:
        JointStatePublisher().init(host, JointStatePublisher.parameters_type(rate=1000.0))
    if commands:
        gains = {f"joint_{i}": {"p": 100.0, "i": 1.0, "d": 10.0} for i in range(JOINTS)}
        plugin = JointCommands()
        host.attach(plugin)
        parameters = JointCommands.parameters_type.model_validate({"pid_gains": {"position": gains}})
        plugin.init(host, parameters)
    names = [f"joint_{i}" for i in range(JOINTS)]
    if moving:
        goal = JointTrajectoryPoint(positions=[0.5] * JOINTS, velocities=[0.0] * JOINTS, time_from_start=DAY)
        transport.deliver["/joint_trajectory"](JointTrajectory(joint_names=names, points=[goal]))
    elif holding:
        transport.deliver["/joint_commands"](JointState(name=names, position=[0.5] * JOINTS))

    def measure() -> float:
        began = perf_counter()
        loop.step(STEPS)
        return (perf_counter() - began) / STEPS * 1e6

    return measure
