"""What a plugin may use of the server, under the names that ROS users know. Physics thread only."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from time import perf_counter
from typing import Any, TypeVar

import mujoco
import numpy as np
from numpy.typing import NDArray

from mjplug.contracts.diagnostics import Diagnosis, Diagnostics, Level
from mjplug.contracts.transport import DEFAULT, LATEST, Call, Publisher, QoS, ServiceName, Topic, Transport
from mjplug.contracts.work import JOB_TIMEOUT, NO_RENDERER, Job, Priority, Work, Worker, WorkerPool, WorkerSpec
from mjplug.errors import PluginError, RequestError
from mjplug.log import INSTANCES
from mjplug.log_scope import logger_of_server
from mjplug.physics.loop import SECOND, Loop
from mjplug.physics.scheduler import Slow, Timer
from mjplug.physics.velocity import VelocityHold
from mjplug.plugin.arrivals import Arrivals
from mjplug.plugin.guard import Guard, Stepping
from mjplug.plugin.stopwatch import Stopwatch
from mjplug.plugin.world_view import WorldView
from mjplug.throttle import Throttle
from mjplug_schemas.errors import NameRuleError
from mjplug_schemas.message import Message, Service

M = TypeVar("M", bound=Message)

Resolve = Callable[[str], str]
"""Turns a name as a plugin writes it into the full ROS name."""


class Host(WorldView):
    """One plugin instance's view of the server, beside that of the world.

    Attributes:
        name: The instance's name.
        logger: Logs under `mjplug.instance.<name>`.
        random: Random numbers of this instance, seeded by `sim.seed` and its name.

    Args:
        name: The instance's name.
        loop: The physics loop.
        transport: Where endpoints are declared.
        resolve: The instance's name rules.
        workers: Who runs the works that the plugin hands over.
        diagnostics: Where the plugin's own state is asked for.
        seed: `sim.seed`.
        disable_on_error: Whether an exception in the plugin's own work switches the plugin off instead of stopping the
            server.
        model_file: The model's file.
        folders: Where relative file names in the instance's parameters count from, first choice first.
        stopwatch: Counts the time that the plugin takes.
        frame_prefix: What stands before the TF frames in the plugin's messages, such as `robot1/`.
    """

    def __init__(
        self,
        name: str,
        loop: Loop,
        transport: Transport,
        resolve: Resolve,
        workers: WorkerPool,
        diagnostics: Diagnostics,
        seed: int = 0,
        disable_on_error: bool = False,
        model_file: Path | None = None,
        folders: Sequence[Path] = (),
        stopwatch: Stopwatch | None = None,
        frame_prefix: str = "",
    ) -> None:
        super().__init__(loop.simulation, model_file, folders)
        self.name = name
        self.logger = logger_of_server(f"{INSTANCES}.{name}")
        self.random = np.random.default_rng([seed, *name.encode()])
        self._stopwatch = stopwatch or Stopwatch()
        self._loop = loop
        self._transport = transport
        self._resolve = resolve
        self._frame_prefix = frame_prefix
        self._workers = workers
        self._diagnostics = diagnostics
        self._guard = Guard(name, self.logger, loop, self._stopwatch, disable_on_error)
        self._sleepers: dict[Publisher[Any], list[Timer]] = {}

    @property
    def velocity_override(self) -> NDArray[np.float64]:
        """Shape (nv,); what `update` writes here becomes that DOF's velocity in `qvel` right before the step.

        NaN leaves it to physics; all entries are NaN before the first plugin's update of each step.
        """
        return self._loop.steppers.velocity_override

    def full_name(self, name: str) -> str:
        """Returns the full ROS name of a topic or service as this plugin writes it, after remapping.

        Raises:
            PluginError: The name breaks ROS's rules.
        """
        try:
            return self._resolve(name)
        except NameRuleError as error:
            raise PluginError(str(error)) from error

    def frame_id(self, name: str) -> str:
        """Returns a TF frame as this plugin's messages name it: with `frame_prefix` before it.

        Args:
            name: Such as `base_link`. With a leading `/` it is shared between robots and gets no prefix: `/map` is
                `map`. The empty name, for no frame, stays empty.
        """
        if name.startswith("/"):
            return name.removeprefix("/")
        return f"{self._frame_prefix}{name}" if name else ""

    def activate(self) -> None:
        """Asks for `update` before every step; costs speed, so ask only while there is something to do."""
        self._guard.activate()

    def deactivate(self) -> None:
        """Ends the calls of `update`."""
        self._guard.deactivate()

    def create_publisher(
        self, type: type[M], name: str, qos: QoS = DEFAULT, on_matched: Callable[[], None] | None = None
    ) -> Publisher[M]:
        """Declares a topic that the plugin publishes.

        Args:
            type: Message class.
            name: `/absolute`; `{ns}/name`, which is `/<namespace>/name`; or relative (`name` and `~/name` mean the
                same) to `/<namespace>/<instance>/`.
            qos: Quality of service.
            on_matched: Called when a first listener appears.

        Raises:
            PluginError: The name breaks ROS's rules.
        """
        sleepers: list[Timer] = []

        def appeared() -> None:
            for timer in sleepers:
                self._loop.scheduler.wake(timer, self.step)
            if on_matched is not None:
                self._guard.guarded(on_matched)()

        topic = Topic(self.full_name(name), type, qos)
        publisher = self._transport.open_publisher(topic, lambda: self._loop.inbox.post(appeared))
        self._sleepers[publisher] = sleepers
        return publisher

    def create_subscription(self, type: type[M], name: str, callback: Callable[[M], None], qos: QoS = LATEST) -> None:
        """Declares a topic that the plugin reads; the newest `qos.depth` messages since the last step are delivered.

        Args:
            type: Message class.
            name: As for `create_publisher`.
            callback: Gets each message, already validated against its type. A RequestError that it raises refuses the
                message: the log has the sentence, at most once a second. Any other exception follows `on_plugin_error`.
            qos: Quality of service; the default delivers the newest message only, as commands want it.
        """
        topic = Topic(self.full_name(name), type, qos)
        refusals = Throttle(SECOND)

        def take(message: M) -> None:
            try:
                callback(message)
            except RequestError as error:
                if refusals.admit(perf_counter()):
                    self.logger.warning("topic %s: a message was refused: %s%s", topic.name, error, refusals.held())

        arrivals = Arrivals(topic.name, qos.depth, self._loop.inbox, self._guard.guarded(take))
        self._transport.open_subscription(topic, arrivals.deliver)

    def create_service(self, type: type[Service], name: str, handler: Callable[[Any, Call], Message | Slow]) -> None:
        """Declares a service.

        Args:
            type: Service class.
            name: As for `create_publisher`.
            handler: Gets the request and the call, returns the response, or is a generator: it yields the step numbers
                or events that it waits for, and returns the response. Its `finally` blocks run on completion, reset and
                shutdown alike. To refuse, raise RequestError before anything has been applied. A generator may answer
                early with `call.respond(…)`.
        """

        def serve(call: Call) -> None:
            if self._guard.disabled:
                call.refuse(self._guard.disabled)
            else:
                began = perf_counter()
                self._loop.serve(call, handler, owner=self._guard)
                self._stopwatch.add(began)

        self._transport.open_service(
            ServiceName(self.full_name(name), type), lambda call: self._loop.inbox.post(lambda: serve(call))
        )

    def create_timer(
        self,
        period: float,
        callback: Callable[[], None],
        while_matched: Publisher[Any] | Sequence[Publisher[Any]] | None = None,
    ) -> Timer:
        """Calls back every `period` [s] of simulated time, first after one period; a reset restarts the phase.

        Args:
            period: Positive; it need not be a multiple of the time step.
            callback: Called on the physics thread.
            while_matched: Publishers of this host, one or several: while nobody listens to any of them, the timer
                sleeps and costs nothing.

        Raises:
            PluginError: The period is not a positive finite number.
        """
        if not 0 < period < float("inf"):
            raise PluginError(f"a timer's period is {period} s; it must be positive and finite")
        loop, simulation = self._loop, self._simulation
        steps = simulation.time.steps_per(period)
        if while_matched is None:
            return loop.scheduler.every(steps, self._guard.guarded(callback), simulation.step)
        publishers = tuple(while_matched) if isinstance(while_matched, Sequence) else (while_matched,)
        if any(publisher not in self._sleepers for publisher in publishers):
            raise PluginError("while_matched is no publisher of this plugin")
        timer = loop.scheduler.every(
            steps,
            self._guard.guarded(callback),
            simulation.step,
            wanted=lambda: any(publisher.matched for publisher in publishers),
        )
        for publisher in publishers:
            self._sleepers[publisher].append(timer)
        return timer

    def create_wall_timer(self, period: float, callback: Callable[[], None]) -> None:
        """Calls back every `period` [s] of wall time, paused or not, at any speed.

        Args:
            period: The server looks once a second, so a shorter one is one second.
            callback: Called on the physics thread.
        """
        due, guarded = 0.0, self._guard.guarded(callback)

        def look(now: float) -> None:
            nonlocal due
            if now >= due:
                due = now + period - 0.5 * SECOND
                guarded()

        self._loop.on_second.append(look)

    def create_velocity_hold(self, dofs: Sequence[int]) -> VelocityHold:
        """Returns what holds the velocities of some degrees of freedom at every step, with no need of `update`.

        What it holds outranks `velocity_override`. At first it holds nothing.

        Args:
            dofs: The degrees of freedom, places in `qvel`.

        Raises:
            MjplugError: The model has no such degree of freedom.
        """
        hold, others = self._simulation.velocity_hold(dofs, self.name)
        if others:
            self.logger.warning(
                "plugin %s holds the same velocities as %s: only one of them has its way", self.name, ", ".join(others)
            )
        self._guard.holds.append(hold)
        return hold

    def claim_controls(self, actuators: Sequence[int]) -> None:
        """Says that the plugin sets the controls of some actuators; the log warns if another one does too.

        Args:
            actuators: Their places in `ctrl`.
        """
        others = self._simulation.claim_controls(actuators, self.name)
        if others:
            names = (mujoco.mj_id2name(self.model, mujoco.mjtObj.mjOBJ_ACTUATOR, a) or str(a) for a in others)
            self.logger.warning(
                "plugin %s sets the same controls as %s, those of %s: each undoes what the other one does",
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
    ) -> Worker:
        """Hands work that is too costly for the physics thread to a process of its own.

        Args:
            work: What to do; see `Work`.
            publishers: Publishers of this host that the work publishes to; the plugin leaves the publishing to it.
            environments: Environment variables for the process, on top of the server's own, tried in this order until
                the work opens; an empty value takes one away. Without them, MuJoCo is imported without OpenGL.
            sync: Whether no step is taken after `submit` until the work is done, so that physics runs in lockstep with
                it. What `update` submits has the state before the step, which is still taken.
            priority: How much processor time the process gets beside other programs: `idle`, `low` or `normal`. In
                lockstep it is normal.
            job_timeout: How long opening the work or a job may take [s], the time not counted in which the process
                waits for a processor. Then the process is started again. Positive; infinity is no limit.
            on_ready: Gets what `Work.open` said, each time the work has been opened.
            on_done: Gets each job that was performed, and what `perform` returned.
            on_lost: Gets the tasks that will not be performed, and why.
        """
        token, lockstep = object(), self._loop.lockstep
        spec = WorkerSpec(
            self.name,
            work,
            tuple(publishers),
            environments,
            sync,
            priority,
            job_timeout,
            lambda hold: lockstep.add(token) if hold else lockstep.discard(token),
            self._guard.guarded(on_ready or _nothing),
            self._guard.guarded(on_done or _nothing),
            self._guard.guarded(on_lost or _nothing),
        )
        return self._workers.start(spec, self._simulation, self._loop.inbox)

    def create_diagnostic(self, name: str, task: Callable[[], Diagnosis]) -> None:
        """Adds a status to `/diagnostics`, as diagnostic_updater's `add` does.

        Args:
            name: What the status is about; the instance's name is put before it. Empty: the instance itself.
            task: Called about once a second of wall time, and answers what to say.
        """

        def ask() -> Diagnosis:
            return Diagnosis(Level.ERROR, self._guard.disabled) if self._guard.disabled else task()

        self._diagnostics.add(f"{self.name}: {name}" if name else self.name, ask)

    def attach(self, plugin: Stepping) -> None:
        """Binds the plugin's `update` and `on_reset` to the loop. The server calls this once, before `init`."""
        self._guard.attach(plugin)


def _nothing(*_: Any) -> None:
    pass
