"""The interface of the server to one plugin instance, with the names of a ROS node's methods. Physics thread only."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from time import perf_counter
from typing import Any, TypeVar

import mujoco
import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel

from mjplug.contracts.diagnostics import Diagnosis, Diagnostics, Level
from mjplug.contracts.parameters import ChangeableParameters, ParameterGroup
from mjplug.contracts.transport import DEFAULT, LATEST, Call, Publisher, QoS, ServiceName, Topic, Transport
from mjplug.contracts.work import JOB_TIMEOUT, NO_RENDERER, Job, Priority, Work, Worker, WorkerPool, WorkerSpec
from mjplug.errors import PluginError, RequestError, is_fault
from mjplug.log import INSTANCES
from mjplug.log_scope import logger_of_server
from mjplug.physics.loop import WALL_TIMER_PERIOD, Loop
from mjplug.physics.scheduler import Slow, Timer
from mjplug.physics.velocity import VelocityHold
from mjplug.plugin.arrivals import Arrivals
from mjplug.plugin.guard import Guard, Stepping
from mjplug.plugin.parameters import Parameters
from mjplug.plugin.stopwatch import Stopwatch
from mjplug.plugin.world_view import WorldView
from mjplug.throttle import Throttle
from mjplug_schemas.errors import NameRuleError
from mjplug_schemas.message import Message, Service

M = TypeVar("M", bound=Message)
P = TypeVar("P", bound=Parameters)

Resolve = Callable[[str], str]
"""Converts a name as a plugin writes it to the full ROS name."""


class Host(WorldView):
    """The server as one plugin instance uses it: topics, services, timers, workers, and the simulated world.

    Attributes:
        name: The instance's name.
        logger: Logger of the instance, named `mjplug.instance.<name>`.
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
        changeable: ChangeableParameters | None = None,
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
        self._changeable = changeable or ChangeableParameters()
        self._workers = workers
        self._diagnostics = diagnostics
        self._guard = Guard(name, self.logger, loop, self._stopwatch, disable_on_error)
        self._timers_by_publisher: dict[Publisher[Any], list[Timer]] = {}

    @property
    def velocity_override(self) -> NDArray[np.float64]:
        """Velocities that replace entries of `qvel` right before the step, shape (nv,) [m/s, rad/s].

        Write to it in `update`. NaN leaves the velocity unchanged; all entries are NaN before the updates of each step.
        """
        return self._loop.steppers.velocity_override

    def full_name(self, name: str) -> str:
        """Returns the full ROS name of a topic or service, after remapping.

        Args:
            name: The name, as for `create_publisher`.

        Raises:
            PluginError: The name is not a valid ROS name.
        """
        try:
            return self._resolve(name)
        except NameRuleError as error:
            raise PluginError(str(error)) from error

    def frame_id(self, name: str) -> str:
        """Returns the name of a TF frame for messages, with `frame_prefix` before it.

        Args:
            name: Name of the frame, such as `base_link`. A leading `/` marks a frame that robots share; it gets no
                prefix: `/map` becomes `map`. An empty name, for no frame, stays empty.
        """
        if name.startswith("/"):
            return name.removeprefix("/")
        return f"{self._frame_prefix}{name}" if name else ""

    def activate(self) -> None:
        """Starts the calls of `update` before every step. They cost speed, so call `deactivate` when idle."""
        self._guard.activate()

    def deactivate(self) -> None:
        """Stops the calls of `update`."""
        self._guard.deactivate()

    def create_publisher(
        self, type: type[M], name: str, qos: QoS = DEFAULT, on_matched: Callable[[], None] | None = None
    ) -> Publisher[M]:
        """Declares a topic that the plugin publishes, and returns its publisher.

        Args:
            type: Message class.
            name: `/absolute`; `{ns}/name`, which is `/<namespace>/name`; or relative (`name` and `~/name` mean the
                same) to `/<namespace>/<instance>/`.
            qos: Quality of service.
            on_matched: Called each time the first subscriber appears.

        Raises:
            PluginError: The name is not a valid ROS name.
        """
        timers: list[Timer] = []

        def matched() -> None:
            for timer in timers:
                self._loop.scheduler.wake(timer, self.step)
            if on_matched is not None:
                self._guard.guarded(on_matched)()

        topic = Topic(self.full_name(name), type, qos)
        publisher = self._transport.open_publisher(topic, lambda: self._loop.inbox.post(matched))
        self._timers_by_publisher[publisher] = timers
        return publisher

    def create_subscription(self, type: type[M], name: str, callback: Callable[[M], None], qos: QoS = LATEST) -> None:
        """Subscribes to a topic. The newest `qos.depth` messages since the last step are delivered.

        Args:
            type: Message class.
            name: As for `create_publisher`.
            callback: Called with each message, after the message was validated against its type. To refuse a message,
                raise RequestError; its text is logged at most once a second. For any other exception, the
                `on_plugin_error` policy applies.
            qos: Quality of service. The default delivers only the newest message, which suits commands.

        Raises:
            PluginError: The name is not a valid ROS name.
        """
        topic = Topic(self.full_name(name), type, qos)
        refusals = Throttle(WALL_TIMER_PERIOD)

        def take(message: M) -> None:
            try:
                callback(message)
            except RequestError as error:
                if refusals.admit(perf_counter()):
                    self.logger.warning(
                        "topic %s: a message was refused: %s%s", topic.name, error, refusals.suppressed()
                    )

        arrivals = Arrivals(topic.name, qos.depth, self._loop.inbox, self._guard.guarded(take))
        self._transport.open_subscription(topic, arrivals.deliver)

    def create_service(self, type: type[Service], name: str, handler: Callable[[Any, Call], Message | Slow]) -> None:
        """Declares a service.

        Args:
            type: Service class.
            name: As for `create_publisher`.
            handler: Called with the request and the call. It returns the response, or it is a generator that yields the
                step numbers or events that it waits for and returns the response. The generator's `finally` blocks run
                on completion, reset and shutdown. To refuse the request, raise RequestError before anything is applied.
                A generator may respond early with `call.respond(…)`.

        Raises:
            PluginError: The name is not a valid ROS name.
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
        """Calls a function periodically in simulated time, first after one period. A reset restarts the phase.

        Args:
            period: Period [s], positive; it need not be a multiple of the time step.
            callback: Called on the physics thread.
            while_matched: One or several publishers of this host. While none of them has a subscriber, the timer sleeps
                at no cost.

        Returns:
            The timer; `cancel()` stops it.

        Raises:
            PluginError: The period is not a positive finite number, or a publisher is not from this host.
        """
        if not 0 < period < float("inf"):
            raise PluginError(f"the timer period is {period} s; it must be positive and finite")
        loop, simulation = self._loop, self._simulation
        steps = simulation.time.steps_per(period)
        if while_matched is None:
            return loop.scheduler.every(steps, self._guard.guarded(callback), simulation.step)
        publishers = tuple(while_matched) if isinstance(while_matched, Sequence) else (while_matched,)
        if any(publisher not in self._timers_by_publisher for publisher in publishers):
            raise PluginError("while_matched contains an object that is not a publisher of this plugin")
        timer = loop.scheduler.every(
            steps,
            self._guard.guarded(callback),
            simulation.step,
            while_true=lambda: any(publisher.matched for publisher in publishers),
        )
        for publisher in publishers:
            self._timers_by_publisher[publisher].append(timer)
        return timer

    def create_wall_timer(self, period: float, callback: Callable[[], None]) -> None:
        """Calls a function periodically in wall time, paused or not, at any speed.

        Args:
            period: Period [s]. The server checks wall timers once a second, so a shorter period means one second.
            callback: Called on the physics thread.
        """
        due, guarded = 0.0, self._guard.guarded(callback)

        def check(now: float) -> None:
            nonlocal due
            if now >= due:
                due = now + period - 0.5 * WALL_TIMER_PERIOD
                guarded()

        self._loop.on_second.append(check)

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
            name: Name of the status, which is published as `<instance>: <name>`; if empty, as `<instance>`.
            task: Returns the status. Called about once a second of wall time.
        """

        def diagnose() -> Diagnosis:
            return Diagnosis(Level.ERROR, self._guard.disabled) if self._guard.disabled else task()

        self._diagnostics.add(f"{self.name}: {name}" if name else self.name, diagnose)

    def create_parameters(self, name: str, values: P, on_change: Callable[[P], None]) -> None:
        """Declares parameters that clients can change while the server runs, for example with `ros2 param set`.

        They are the numbers, texts and truth values among the fields of `values`. The full name of each is
        `plugins.<instance>.<name>.<field>`, as in the configuration file.

        Args:
            name: Name of the group, such as `pid_gains.position.joint1`.
            values: The values at the start.
            on_change: Called between two steps with new values that are valid for the class of `values`. It applies
                them. To refuse them, raise RequestError before anything has been applied.
        """

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

        self._changeable.add(f"plugins.{self.name}.{name}", ParameterGroup[BaseModel](values, change))

    def attach(self, plugin: Stepping) -> None:
        """Binds the plugin's `update` and `on_reset` to the loop. The server calls this once, before `init`."""
        self._guard.attach(plugin)


def _nothing(*_: Any) -> None:
    pass
