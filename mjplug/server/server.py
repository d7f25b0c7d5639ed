"""Assembles model, loop, services and plugins, runs them, and cleans them up in the reverse order."""

import logging
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from time import perf_counter
from typing import Any

from mjplug import __version__
from mjplug.config.instance_names import InstanceNames, instance_names, server_names
from mjplug.config.settings import Settings
from mjplug.contracts.actions import ActionTransport
from mjplug.contracts.diagnostics import Diagnostics
from mjplug.contracts.parameters import ChangeableParameters
from mjplug.contracts.topics import Topics
from mjplug.contracts.work import WorkerPool
from mjplug.errors import MjplugError, PluginError, is_fault
from mjplug.model.file import LoadedModel
from mjplug.model.library import Library
from mjplug.model.recipe import Source
from mjplug.physics import process
from mjplug.physics.loop import Loop
from mjplug.physics.simulation import Simulation
from mjplug.plugin import Host, Plugin
from mjplug.plugin.selection import Selected
from mjplug.services import (
    clock,
    diagnostics,
    parameters,
    reset_world,
    rosout,
    set_free_joint_state,
    set_pause,
    step_simulation,
)
from mjplug.services.plugin_times import PluginTimes
from mjplug.services.rollout import service as rollout
from mjplug.services.standard import model_changed, model_values
from mjplug.services.standard import service as standard
from mjplug.services.standard.world_builder import WorldBuilder
from mjplug.services.states import service as states
from mjplug.services.stepping import service as stepping
from mjplug.services.view import service as view
from mjplug_schemas import names
from mjplug_schemas.simulation_interfaces import Resource, WorldResource

_log = logging.getLogger(__name__)


class Server:
    """One simulation with its services and plugins, on a transport.

    Attributes:
        loop: The physics loop.
        plugins: The running plugins by instance name.
        diagnostics: The diagnostics of the server and its plugins.
        topics: The topics of the server and its plugins.
        ownership: Which client steps the server.
        on_stopping: Called when the loop has ended, before requests are cancelled and plugins are cleaned up.

    Args:
        settings: The configuration.
        simulation: The model and its state.
        transport: Declares the topics and services; the caller closes it after `run`.
        plugins: The plugins to run, in the order of their updates.
        workers: Starts the worker processes of the plugins; the caller closes it after `run`.
        model: The model with its file; None if it was not loaded from a file.
        states_folder: The folder of saved states; None if there is none.
        spawnables: The folders with models that clients may add.

    Raises:
        PluginError: Plugins refused to start; the text names all of them. Plugins that had started are cleaned up.
    """

    def __init__(
        self,
        settings: Settings,
        simulation: Simulation,
        transport: ActionTransport,
        plugins: Sequence[Selected],
        workers: WorkerPool,
        model: LoadedModel | None = None,
        states_folder: Path | None = None,
        spawnables: Sequence[Path] = (),
    ) -> None:
        sim = settings.sim
        self.loop = Loop(simulation, sim.speed, sim.paused, sim.on_divergence)
        self.plugins: dict[str, Plugin[Any]] = {}
        self.on_stopping: list[Callable[[], None]] = []
        self._settings = settings
        self._transport = transport
        self._workers = workers
        self._model_file = None if model is None else model.described_by
        self.diagnostics = Diagnostics()
        self._changeable = ChangeableParameters()
        self.topics = Topics()
        self._cleanups = ExitStack()
        self._times = PluginTimes(self.loop, perf_counter())
        # Before the diagnostics are published.
        self.loop.on_second.append(self._times.refresh)
        host = self._host(settings.node_name, server_names(settings), disable_on_error=False)
        name = f"{settings.namespace}/{settings.node_name}"
        for service in (set_pause, reset_world, set_free_joint_state):
            service.offer(host, self.loop)
        limits = states.Limits(settings.snapshots.max_states, settings.snapshots.max_bytes)
        saved = states.offer(host, self.loop, sim.seed, __version__, limits, states_folder)
        self._cleanups.callback(saved.close)
        self.ownership = stepping.offer(host, self.loop, transport, self.topics, names.key(name))
        step_simulation.offer(host, self.loop, self.ownership)
        self._cleanups.callback(rollout.offer(host, self.loop, saved.vector))
        clock.offer(host, self.loop, sim.clock_rate)
        if settings.simulation_interfaces.enabled:
            builder = self._builder(host, saved.keeper.model_digest, model)
            standard.offer(
                host,
                self.loop,
                settings.simulation_interfaces,
                self.ownership,
                saved.keeper.restart_time,
                _world(model),
                builder,
                Library(spawnables),
            )
        parameters.offer(host, self.loop, settings, self._changeable)
        diagnostics.offer(host, self.loop, self.diagnostics, name)
        types = {instance: entry.type for instance, entry in settings.plugins.items()}
        view.offer(self.loop, transport, workers, names.key(name), types)
        self.diagnostics.add("plugins", self._times.diagnose)
        # Started before the plugins and ended after them, so that their log lines are published.
        packages = [selected.plugin_class.__module__.partition(".")[0] for selected in plugins]
        self._cleanups.callback(rosout.offer(host, self.loop, name, packages))
        try:
            self._start_all(plugins)
        except BaseException:
            self._cleanups.close()
            raise

    def _builder(self, host: Host, digest: str, model: LoadedModel | None) -> WorldBuilder | None:
        """Returns what changes the model; None if MuJoCo cannot compile it again."""
        if model is None or model.source.suffix.lower() == ".mjb":
            return None
        wait = self._settings.simulation_interfaces.spawn_wait
        builder = WorldBuilder(self.loop, self._workers, Source(model.source), digest, wait)
        model_changed.offer(host, builder, digest)
        model_values.offer(host, builder)
        self._cleanups.callback(builder.close)
        return builder

    def run(self, duration: float | None = None) -> None:
        """Runs the loop in the calling thread until it is stopped, fails, or has simulated `duration` [s].

        Raises:
            MjplugError: A plugin failed, or the simulation diverged, under a policy that stops the server.
        """
        loop = self.loop
        if duration is not None:
            loop.last_step = loop.simulation.time.steps_covering(round(duration * 1e9))
        try:
            with process.fast_thread_switching():
                process.prefer_this_thread()
                loop.run()
        finally:
            self.end()
        if loop.failure is not None:
            raise loop.failure

    def end(self) -> None:
        """Cancels the waiting requests, and cleans up the plugins. A second call does nothing."""
        callbacks, self.on_stopping = self.on_stopping, []
        with self._cleanups:
            for callback in callbacks:
                callback()
            self.loop.scheduler.cancel("cancelled: the server is stopping")

    def cleanup(self) -> None:
        """Cleans up the plugins of a server that has not run."""
        self._cleanups.close()

    def _start_all(self, plugins: Sequence[Selected]) -> None:
        """Starts the plugins. The error contains the reasons of all that refuse, so that they can be fixed together."""
        refusals: list[PluginError] = []
        for selected in plugins:
            try:
                self._start(selected)
            except PluginError as error:
                refusals.append(error)
        if len(refusals) > 1:
            lines = "\n".join(f"  {refusal}" for refusal in refusals)
            raise PluginError(f"{len(refusals)} plugins did not start:\n{lines}") from refusals[0]
        if refusals:
            raise refusals[0]

    def _start(self, selected: Selected) -> None:
        names = instance_names(self._settings, selected.name)
        host = self._host(selected.name, names, self._settings.on_plugin_error == "disable", selected.folders)
        plugin = self.plugins[selected.name] = selected.plugin_class()
        self._cleanups.callback(self._clean_up, selected.name, plugin.cleanup)
        host.attach(plugin, selected.parameters)
        try:
            plugin.init(host, selected.parameters)
        except MjplugError as error:
            raise PluginError(f"plugin {selected.name} refused to start: {error}") from error
        except BaseException as error:
            if not is_fault(error):
                raise
            _log.exception("plugin %s failed to start", selected.name)
            raise PluginError(f"plugin {selected.name} failed to start: {error!r}") from error

    def _host(self, name: str, names: InstanceNames, disable_on_error: bool, folders: Sequence[Path] = ()) -> Host:
        return Host(
            name,
            self.loop,
            self._transport,
            names.full_name,
            self._workers,
            self.diagnostics,
            self._settings.sim.seed,
            disable_on_error,
            self._model_file,
            folders,
            self._times.add(name),
            names.frame_prefix,
            self._changeable,
            self.topics,
        )

    @staticmethod
    def _clean_up(name: str, cleanup: Callable[[], None]) -> None:
        try:
            cleanup()
        except BaseException as error:
            if not is_fault(error):
                raise
            _log.exception("plugin %s failed while it was cleaned up", name)


def _world(model: LoadedModel | None) -> WorldResource:
    """Returns the loaded world for clients."""
    if model is None:
        return WorldResource()
    return WorldResource(name=model.name, world_resource=Resource(uri=model.path.absolute().as_uri()))
