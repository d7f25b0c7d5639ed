"""The measured servers: complete servers on a real Zenoh session."""

import json
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from time import perf_counter

import mujoco
import zenoh

from mjplug.config.settings import Settings
from mjplug.model.file import load_model
from mjplug.physics import process
from mjplug.physics.simulation import Simulation
from mjplug.plugin import registry
from mjplug.plugin.selection import Selected
from mjplug.server.offline import OfflineWorkerPool
from mjplug.server.server import Server
from mjplug.wire.network import Network, open_network
from mjplug.wire.rmw_zenoh.keys import RosSettings
from mjplug.wire.session import SessionSettings
from mjplug_plugins.external_wrench import ExternalWrench
from mjplug_plugins.heartbeat import Heartbeat

SMALL, MIDDLING = str(Path(__file__).parent / "small.xml"), "bundled:quadruped"
"""Models with about 10 and 20 µs per step on an idle machine."""

PLUGINS = [
    Selected(name, plugin, plugin.parameters_type())
    for name, plugin in (("heartbeat", Heartbeat), ("external_wrench", ExternalWrench))
]


def every_plugin(base: str) -> list[Selected]:
    """Returns an instance of each mujoco_ros2_control_plugins plugin, with default parameters; `base` is driven."""
    required = {"base_velocity": {"body": base, "cmd_timeout": float("inf")}}
    points = registry.registered()
    theirs = {point.value for name, point in points.items() if name.startswith("mujoco_ros2_control_plugins/")}
    plugins = []
    for name, point in points.items():
        if "/" not in name and point.value in theirs:
            plugin = registry.find(name)
            plugins.append(Selected(name, plugin, plugin.parameters_type(**required.get(name, {}))))
    return plugins


def model_of(uri: str) -> mujoco.MjModel:
    """Compiles a model; every call returns a new one."""
    return load_model(uri).model


@contextmanager
def network(ros2: RosSettings | None = None) -> Iterator[Network]:
    """Opens a session on a free port of this machine; without `ros2`, only for clients without rmw_zenoh."""
    opened = open_network(SessionSettings(listen=("tcp/127.0.0.1:0",)), "/mjplug", ros2=ros2)
    try:
        yield opened
    finally:
        opened.close()


@contextmanager
def server(
    uri: str, speed: float | str = "max", timestep: float | None = None, plugins: Sequence[Selected] = PLUGINS
) -> Iterator[tuple[Server, Network]]:
    """Creates a complete server in this process, by default with Heartbeat and ExternalWrench."""
    settings = Settings.model_validate({"model": uri, "sim": {"speed": speed}})
    model = model_of(uri)
    if timestep is not None:
        model.opt.timestep = timestep
    with network() as opened:
        keyframe = model.key(0).name if model.nkey else ""
        yield Server(settings, Simulation(model, keyframe), opened, plugins, OfflineWorkerPool()), opened


@contextmanager
def client(endpoint: str) -> Iterator[zenoh.Session]:
    """Opens a Zenoh client session."""
    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", json.dumps([endpoint]))
    with zenoh.open(config) as session:
        yield session


class BareLoop:
    """A loop of `mj_step(nstep=100)` on the same model, from the same state."""

    def __init__(self, uri: str) -> None:
        self._model = model_of(uri)
        self._data = mujoco.MjData(self._model)
        if self._model.nkey:
            mujoco.mj_resetDataKeyframe(self._model, self._data, 0)

    def steps_per_second(self, steps: int) -> float:
        """Runs `steps` steps, a multiple of 100, and returns the steps per second."""
        began = perf_counter()
        for _ in range(steps // 100):
            mujoco.mj_step(self._model, self._data, nstep=100)
        return steps / (perf_counter() - began)


process.configure_mujoco()
