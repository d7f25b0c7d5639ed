"""Loads a configuration, its model and its plugin classes, before the network is opened."""

import logging
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

from mjplug.config.draft import Draft, Loaded
from mjplug.config.problem import ConfigError
from mjplug.convert.load import load_model, load_received
from mjplug.errors import ModelError, UnknownName
from mjplug.model import engine_plugins
from mjplug.model.file import LoadedModel
from mjplug.physics import process
from mjplug.physics.simulation import Simulation
from mjplug.plugin.folder_modules import importable
from mjplug.plugin.selection import Classes, Selected, select
from mjplug.server.drafts import log_conversion, log_report
from mjplug.server.offline import OfflineTransport, OfflineWorkerPool
from mjplug.server.server import Server
from mjplug.server.starting_pose import take_starting_pose
from mjplug.server.topic_model import is_topic, wait_for

PROGRESS_AFTER = 2.0
"""Time after which the log reports that the model is still being compiled [s]."""

_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Prepared:
    """A configuration, model and plugins, from which a server is opened. Its changes to the process last until `close`.

    Attributes:
        loaded: The configuration.
        plugins: The plugins to run, in the order of their updates.
        model: The model and its file.
        simulation: The model and its initial state.
        changes: Undoes the changes to the process.
        topic: The topic that the model comes from; empty if it comes from a file.
    """

    loaded: Loaded
    plugins: list[Selected]
    model: LoadedModel
    simulation: Simulation
    changes: ExitStack
    topic: str = ""

    @property
    def name(self) -> str:
        """The server's full name, such as `/robot1/mjplug`."""
        return f"{self.loaded.settings.namespace}/{self.loaded.settings.node_name}"

    @property
    def summary(self) -> str:
        """One line with the model and the plugins."""
        names = ", ".join(plugin.name for plugin in self.plugins) or "none"
        return f"model {self.model.name} ({_size(self.simulation)}) · plugins: {names}"

    def close(self) -> None:
        """Undoes the changes to the process: import folders and MuJoCo's handlers. A second call does nothing."""
        self.changes.close()


def prepare(draft: Draft, classes: Classes = MappingProxyType({})) -> Prepared:
    """Validates a configuration, loads the model and takes the starting pose.

    Args:
        draft: The configuration.
        classes: Plugin classes that need not be imported, by the type under which the configuration names them.

    Raises:
        ConfigError: The configuration is invalid.
        ModelError: The model cannot be loaded.
    """
    with ExitStack() as changes:
        changes.enter_context(importable(draft.folder))
        loaded, plugins = select(draft, classes)
        settings = loaded.settings
        for warning in loaded.warnings:
            # The text has several lines, and quoted values in it are already escaped.
            _log.warning("%s", warning, extra={"printable": True})
        changes.enter_context(process.mujoco_configured())
        _load_engine_plugins(loaded)
        received = draft.received
        if received is None and is_topic(settings.model):
            received = wait_for(loaded).receive()
        with _progress(f"compiling {settings.model}"):
            progress = log_conversion(settings.model)
            if received is not None:
                model = load_received(received, draft.model_options, progress=progress, done=log_report)
            else:
                model = load_model(
                    settings.model,
                    *loaded.folders(("model",)),
                    options=draft.model_options,
                    progress=progress,
                    done=log_report,
                )
        keyframe = settings.sim.keyframe
        if not (keyframe or settings.sim.start_position_file):
            keyframe = model.keyframe
        try:
            simulation = Simulation(model.model, keyframe)
        except UnknownName as error:
            raise ConfigError([loaded.problem(("sim", "keyframe"), str(error))]) from error
        take_starting_pose(simulation, loaded, keyframe)
        if not keyframe and (keyframes := simulation.keyframes()):
            _log.info("the model starts in its default pose; other keyframes (--keyframe): %s", ", ".join(keyframes))
        topic = "" if received is None else received.topic
        return Prepared(loaded, plugins, model, simulation, changes.pop_all(), topic)


def _load_engine_plugins(loaded: Loaded) -> None:
    for i in range(len(loaded.settings.sim.plugin_libraries)):
        path = ("sim", "plugin_libraries", i)
        file = loaded.path(path)
        try:
            # The file existed when the configuration was checked.
            engine_plugins.load(file or Path(loaded.settings.sim.plugin_libraries[i]))
        except ModelError as error:
            raise ConfigError([loaded.problem(path, str(error))]) from error


def check(prepared: Prepared) -> None:
    """Starts the plugins without a network, and then cleans them up.

    Raises:
        PluginError: A plugin refused to start.
    """
    settings = prepared.loaded.settings
    server = Server(
        settings, prepared.simulation, OfflineTransport(), prepared.plugins, OfflineWorkerPool(), prepared.model
    )
    server.cleanup()


def _size(simulation: Simulation) -> str:
    model = simulation.model
    counts = (
        _counted(model.nbody - 1, "body", "bodies"),
        _counted(model.nv, "DOF", "DOFs"),
        _counted(model.nu, "actuator", "actuators"),
    )
    return f"{', '.join(counts)}, {float(model.opt.timestep) * 1e3:g} ms steps"


def _counted(count: int, one: str, several: str) -> str:
    return f"{count} {one if count == 1 else several}"


@contextmanager
def _progress(what: str) -> Iterator[None]:
    """Logs a line if the block takes longer than `PROGRESS_AFTER`."""
    timer = threading.Timer(PROGRESS_AFTER, _log.info, (f"{what} ...",))
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
