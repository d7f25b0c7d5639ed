"""The interface of the server to one plugin instance. Physics thread only.

`WorldView` contains the simulated world, and `NodeView` names, topics, services and timers. This module adds
updates before every step, velocities, controls, worker processes, diagnostics and changeable parameters.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

import mujoco
import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel

from mjplug.contracts.actions import ActionTransport
from mjplug.contracts.diagnostics import Diagnosis, Diagnostics, Level
from mjplug.contracts.parameters import ChangeableParameters, ParameterGroup
from mjplug.contracts.remote_samples import RemoteSamples
from mjplug.contracts.topics import Topics
from mjplug.contracts.transport import Publisher
from mjplug.contracts.work import JOB_TIMEOUT, NO_RENDERER, Job, Priority, Work, Worker, WorkerPool, WorkerSpec
from mjplug.errors import PluginError, RequestError, is_fault
from mjplug.physics.loop import Loop
from mjplug.physics.velocity import VelocityHold
from mjplug.plugin.follower import Follower, Following
from mjplug.plugin.guard import Stepping
from mjplug.plugin.instance_part import InstancePart
from mjplug.plugin.node_view import NodeView, Resolve
from mjplug.plugin.parameters import Parameters
from mjplug.plugin.stopwatch import Stopwatch

P = TypeVar("P", bound=Parameters)


class Host(NodeView):
    """The server as one plugin instance uses it: topics, services, timers, workers, and the simulated world.

    The public methods of the base classes are part of the plugin API too.

    Attributes:
        random: Random number generator of the instance, seeded with `sim.seed` and the instance's name.

    Args:
        name: The instance's name.
        loop: The physics loop.
        transport: Declares topics and services.
        resolve: Converts names of topics and services to full ROS names.
        workers: Runs the worker processes of the plugin.
        diagnostics: Collects the diagnostic tasks of all plugins.
        seed: `sim.seed`.
        disable_on_error: Whether an exception in the plugin disables the instance instead of stopping the server.
        model_file: The model's file.
        folders: Folders in which relative file names of parameters are searched, in this order.
        stopwatch: Measures the time that the plugin takes.
        frame_prefix: Prefix of the TF frames in the plugin's messages, such as `robot1/`.
        changeable: Where parameters that clients can change are declared.
        topics: Where topics are registered for step requests.
    """

    def __init__(
        self,
        name: str,
        loop: Loop,
        transport: ActionTransport,
        resolve: Resolve,
        workers: WorkerPool,
        diagnostics: Diagnostics,
        seed: int = 0,
        disable_on_error: bool = False,
        model_file: Path | None = None,
        folders: Sequence[Path] = (),
        stopwatch: Stopwatch | None = None,
        frame_prefix: str = "",
        changeable: ChangeableParameters | None = None,
        topics: Topics | None = None,
    ) -> None:
        super().__init__(
            name,
            loop,
            transport,
            resolve,
            disable_on_error,
            model_file,
            folders,
            stopwatch or Stopwatch(),
            frame_prefix,
            topics or Topics(),
        )
        entropy = self._entropy = [seed, *name.encode()]
        self._own_workers: list[Callable[[], None]] = []
        self._statuses: list[str] = []
        self.random = np.random.default_rng(entropy)
        self._part = InstancePart(self._guard, lambda: self.random, entropy)
        loop.parts.append(self._part)
        loop.on_model_changed.append(lambda change: self._use_model())
        self._changeable = changeable or ChangeableParameters()
        self._workers = workers
        self._diagnostics = diagnostics

    @property
    def velocity_override(self) -> NDArray[np.float64]:
        """Velocities that replace entries of `qvel` right before the step, shape (nv,) [m/s, rad/s].

        Write to it in `update`. NaN leaves the velocity unchanged; all entries are NaN before the updates of each step.
        """
        return self._loop.steppers.velocity_override

    def activate(self) -> None:
        """Starts the calls of `update` before every step. They cost speed, so call `deactivate` when idle."""
        self._guard.activate()

    def deactivate(self) -> None:
        """Stops the calls of `update`."""
        self._guard.deactivate()

    def create_velocity_hold(self, dofs: Sequence[int]) -> VelocityHold:
        """Returns a hold that sets the velocities of some degrees of freedom at every step without calls of `update`.

        Held velocities take precedence over `velocity_override`. At first nothing is held.

        Args:
            dofs: The degrees of freedom, as indices in `qvel`.

        Raises:
            MjplugError: The model has no such degree of freedom.
        """
        hold, others = self._simulation.velocity_hold(dofs, self.name)
        if others:
            self.logger.warning(
                "plugins %s and %s set the same velocities; only one of them takes effect",
                self.name,
                ", ".join(sorted(others)),
            )
        self._guard.holds.append(hold)
        return hold

    def claim_controls(self, actuators: Sequence[int]) -> None:
        """Declares that the plugin sets the controls of some actuators; logs a warning if another plugin does too.

        Args:
            actuators: The actuators, as indices in `ctrl`.
        """
        others = self._simulation.claim_controls(actuators, self.name)
        if others:
            names = (mujoco.mj_id2name(self.model, mujoco.mjtObj.mjOBJ_ACTUATOR, a) or str(a) for a in others)
            self.logger.warning(
                "plugins %s and %s set the controls of the same actuators (%s); each overwrites the other",
                self.name,
                ", ".join(sorted(set(others.values()))),
                ", ".join(names),
            )

    def create_worker(
        self,
        work: Work,
        publishers: Sequence[Publisher[Any]],
        *,
        environments: Sequence[Mapping[str, str]] = NO_RENDERER,
        sync: bool = False,
        priority: Priority = "low",
        job_timeout: float = JOB_TIMEOUT,
        on_ready: Callable[[str], None] | None = None,
        on_done: Callable[[Job, Any], None] | None = None,
        on_lost: Callable[[frozenset[str], str], None] | None = None,
        sample_tasks: Mapping[Publisher[Any], Iterable[str]] | None = None,
    ) -> Worker:
        """Runs work that is too slow for the physics thread in a worker process.

        Args:
            work: The work; see `Work`.
            publishers: Publishers of this host that the work publishes to. The plugin itself must not use them.
            environments: Environment variables for the process, in addition to the server's; an empty value removes a
                variable. They are tried in this order until the work opens. The default imports MuJoCo without OpenGL.
            sync: Whether the loop takes no step after `submit` until the job is done (lockstep). A job that `update`
                submits contains the state before the step; that step is still taken.
            priority: CPU priority of the process: `idle`, `low` or `normal`. In lockstep it is always normal.
            job_timeout: Maximum time for opening the work and for a job [s], without the time in which the process
                waits for a CPU. After it, the process is restarted. Positive; infinity means no limit.
            on_ready: Called with the text that `Work.open` returned, each time the work has been opened.
            on_done: Called with each completed job and the return value of `perform`.
            on_lost: Called with the tasks that will not be performed, and the reason.
            sample_tasks: The tasks that publish the topic of each publisher. With `sync`, clients that step the
                simulation with `~/step` then get a sample of the topic for the state after their last step.
        """
        # While the token of a worker is in the loop's set, the loop takes no step.
        token, lockstep, current = object(), self._loop.lockstep, [True]

        def while_current(callback: Callable[..., None]) -> Callable[..., None]:
            guarded = self._guard.guarded(callback)
            # A worker of the previous model may still report a job.
            return lambda *args: guarded(*args) if current else None

        tasks = [tuple((sample_tasks or {}).get(publisher, ())) for publisher in publishers]
        samples = RemoteSamples(sync, tasks, while_current(on_done or _nothing), while_current(on_lost or _nothing))
        for index, publisher in enumerate(publishers):
            self._published[publisher].remote = samples, index
        spec = WorkerSpec(
            self.name,
            work,
            tuple(publishers),
            environments,
            sync,
            priority,
            job_timeout,
            lambda block: lockstep.add(token) if block and current else lockstep.discard(token),
            while_current(on_ready or _nothing),
            samples.done,
            samples.lost,
        )
        worker = samples.worker = self._workers.start(spec, self._simulation, self._loop.inbox)

        def end() -> None:
            samples.end("the model has changed")
            current.clear()
            lockstep.discard(token)
            worker.stop()

        self._own_workers.append(end)
        return worker

    def create_diagnostic(self, name: str, task: Callable[[], Diagnosis]) -> None:
        """Adds a status to `/diagnostics`, as diagnostic_updater's `add` does.

        Args:
            name: Name of the status, which is published as `<instance>: <name>`; if empty, as `<instance>`.
            task: Returns the status. Called about once a second of wall time.
        """

        def diagnose() -> Diagnosis:
            return Diagnosis(Level.ERROR, self._guard.disabled) if self._guard.disabled else task()

        status = f"{self.name}: {name}" if name else self.name
        self._statuses.append(status)
        self._diagnostics.add(status, diagnose)

    def create_parameters(self, name: str, values: P, on_change: Callable[[P], None]) -> None:
        """Declares parameters that clients can change while the server runs, for example with `ros2 param set`.

        They are the numbers, strings and booleans among the fields of `values`. The full name of each is
        `plugins.<instance>.<name>.<field>`, as in the configuration file.

        Args:
            name: Name of the group, such as `pid_gains.position.joint1`. If empty, the full names are
                `plugins.<instance>.<field>`.
            values: The values at the start.
            on_change: Called between two steps with new values that are valid for the class of `values`. It applies
                them. To refuse them, raise RequestError before anything has been applied.

        Raises:
            PluginError: The plugin has already declared a group of this name.
        """
        group = f"plugins.{self.name}.{name}" if name else f"plugins.{self.name}"
        if group in self._changeable.groups:
            raise PluginError(f"the parameters {group} are declared twice")

        def change(new: Any) -> None:
            if self._guard.disabled:
                raise RequestError(self._guard.disabled)
            try:
                on_change(new)
            except RequestError:
                raise
            except BaseException as error:
                if not is_fault(error):
                    raise
                self._guard.fail(error)
                raise RequestError(f"plugin {self.name} failed: {error!r}") from error

        self._part.groups[name] = declared = ParameterGroup[BaseModel](values, change)
        self._changeable.add(group, declared)

    def attach(self, plugin: Stepping, parameters: Any = None) -> None:
        """Makes the loop call the plugin's `on_reset`, its `update` while it is active, and `on_model_changed`.

        The server calls this once, before `init`.

        Args:
            plugin: The plugin.
            parameters: Its parameters, with which it is started again when the model has changed.
        """
        self._guard.attach(plugin)
        self._part.attach(self.name, plugin)
        if isinstance(plugin, Following):
            follower = Follower(plugin, parameters, self, self._guard, self._part)
            self._loop.on_model_changing.append(follower.prepare)
            self._loop.on_model_changed.append(follower.follow)

    def _release(self) -> None:
        super()._release()
        for end in self._own_workers:
            end()
        for status in self._statuses:
            self._diagnostics.remove(status)
        for group in self._part.groups:
            self._changeable.remove(f"plugins.{self.name}.{group}" if group else f"plugins.{self.name}")
        self._part.groups.clear()
        self._own_workers.clear()
        self._statuses.clear()
        # Seeds that `init` draws are the same as before.
        self.random = np.random.default_rng(self._entropy)


def _nothing(*_: Any) -> None:
    pass
