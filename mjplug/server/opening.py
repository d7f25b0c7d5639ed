"""From a configuration to a server on the network."""

import logging
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from time import perf_counter

from mjplug.config.draft import Draft, Loaded
from mjplug.config.problem import ConfigError
from mjplug.errors import UnknownName
from mjplug.model.file import LoadedModel, load_model
from mjplug.physics import process
from mjplug.physics.simulation import Simulation
from mjplug.plugin.selection import Selected, select
from mjplug.server.offline import OfflineTransport, OfflineWorkerPool
from mjplug.server.rehearsal import rehearse
from mjplug.server.server import Server
from mjplug.server.starting_pose import take_starting_pose
from mjplug.wire.diagnostics import WireDiagnostics
from mjplug.wire.encoding import Limits
from mjplug.wire.network import Network, open_network
from mjplug.wire.rmw_zenoh.keys import RosSettings
from mjplug.wire.secured import secured
from mjplug.wire.session import SessionSettings
from mjplug.wire.topic_rates import TopicRates
from mjplug.worker.pool import ProcessWorkerPool

PROGRESS_AFTER = 2.0
"""Time after which a line in the log says that the model is still compiling [s]."""

_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class World:
    """What a server serves.

    Attributes:
        loaded: The configuration.
        plugins: What runs, in the order of their updates.
        model: The model and its file.
        simulation: The model and its state, at the start.
    """

    loaded: Loaded
    plugins: list[Selected]
    model: LoadedModel
    simulation: Simulation

    @property
    def name(self) -> str:
        """The server's full name, such as `/robot1/mjplug`."""
        return f"{self.loaded.settings.namespace}/{self.loaded.settings.node_name}"

    @property
    def summary(self) -> str:
        """Model and plugins, in one line."""
        names = ", ".join(plugin.name for plugin in self.plugins) or "none"
        return f"model {self.model.name} ({_size(self.simulation)}) · plugins: {names}"


def prepare(draft: Draft) -> World:
    """Validates a configuration, loads the model and takes the starting pose.

    Raises:
        ConfigError: The configuration is wrong.
        ModelError: The model cannot be loaded.
    """
    loaded, plugins = select(draft)
    settings = loaded.settings
    for warning in loaded.warnings:
        # A problem has several lines, and has escaped what it quotes.
        _log.warning("%s", warning, extra={"printable": True})
    process.tame_mujoco()
    with _progress(f"compiling {settings.model}"):
        model = load_model(settings.model, *loaded.folders(("model",)))
    try:
        simulation = Simulation(model.model, settings.sim.keyframe)
    except UnknownName as error:
        raise ConfigError([loaded.problem(("sim", "keyframe"), str(error))]) from error
    take_starting_pose(simulation, loaded)
    if not settings.sim.keyframe and (keyframes := simulation.keyframes()):
        _log.info("the model starts in its default pose; other keyframes (--keyframe): %s", ", ".join(keyframes))
    return World(loaded, plugins, model, simulation)


def check(world: World) -> None:
    """Starts the plugins without a network, and cleans them up.

    Raises:
        PluginError: A plugin refused to start.
    """
    settings = world.loaded.settings
    Server(
        settings, world.simulation, OfflineTransport(), world.plugins, OfflineWorkerPool(), world.model.path
    ).cleanup()


class OpenServer:
    """A server on the network, which does not run yet.

    Attributes:
        server: The server.
        network: Its transport.

    Args:
        world: What it serves.

    Raises:
        WireError: It cannot get onto the network.
        PluginError: A plugin refused to start.
    """

    def __init__(self, world: World) -> None:
        settings, simulation, model = world.loaded.settings, world.simulation, world.model
        zenoh = settings.zenoh
        wanted = SessionSettings(zenoh.mode, zenoh.listen, zenoh.connect, world.loaded.path(("zenoh", "config")))
        ros2 = None
        if settings.ros2.enabled:
            ros2 = RosSettings(settings.ros2.domain_id, settings.ros2.distro)
        wanted = secured(
            wanted, lambda: rehearse(world.loaded, simulation.model, world.plugins, model.path, world.name, ros2)
        )
        limits = Limits(zenoh.max_payload_bytes, zenoh.max_json_bytes)
        self.network: Network = open_network(wanted, world.name, limits, ros2=ros2)
        self._workers = ProcessWorkerPool(wanted, self.network.session.endpoints)
        try:
            self.server = Server(settings, simulation, self.network, world.plugins, self._workers, model.path)
        except BaseException:
            self._workers.close()
            self.network.close("the server could not start")
            raise
        rates = TopicRates(self.network, perf_counter())
        self.server.loop.on_second.insert(0, rates.look)
        self.server.diagnostics.add("wire", WireDiagnostics(self.network).diagnose)
        self.server.diagnostics.add("topics", rates.diagnose)

    def close(self) -> None:
        """Ends the worker processes and leaves the network."""
        self._workers.close()
        self.network.close("the server is stopping")


def _size(simulation: Simulation) -> str:
    model = simulation.model
    bodies = "1 body" if model.nbody == 2 else f"{model.nbody - 1} bodies"
    return f"{bodies}, {model.nv} DOFs, {model.nu} actuators, {float(model.opt.timestep) * 1e3:g} ms steps"


@contextmanager
def _progress(what: str) -> Iterator[None]:
    """Says after a while that something still goes on."""
    timer = threading.Timer(PROGRESS_AFTER, _log.info, (f"{what} ...",))
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
