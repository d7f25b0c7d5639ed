"""What a plugin may use of the server, under the names that ROS users know. Physics thread only."""

import logging
from collections.abc import Callable, Mapping, Sequence
from itertools import count
from pathlib import Path
from time import perf_counter
from typing import Any, ParamSpec, Protocol, TypeVar

import mujoco
import numpy as np
from numpy.typing import NDArray

from mjplug.core.loop import Loop
from mjplug.core.model_location import locate
from mjplug.core.scheduler import Slow, Timer
from mjplug.core.steppers import Stepper
from mjplug.core.velocity import VelocityHold
from mjplug.diagnosis import Diagnosis, Diagnostics, Level
from mjplug.errors import PluginError
from mjplug.log import INSTANCES
from mjplug.plugin.stopwatch import Stopwatch
from mjplug.transport import DEFAULT, LATEST, Call, Publisher, QoS, ServiceName, Topic, Transport
from mjplug.work import NO_RENDERER, Job, Order, Work, Worker, Workers
from mjplug_schemas.builtin_interfaces import Time
from mjplug_schemas.errors import NameRuleError
from mjplug_schemas.message import Message, Service

M = TypeVar("M", bound=Message)
P = ParamSpec("P")

Resolve = Callable[[str], str]
"""Turns a name as a plugin writes it into the full ROS name."""


class Stepping(Protocol):
    """The part of a plugin that the loop calls."""

    def update(self) -> None:
        """Runs before every step while active."""

    def on_reset(self) -> None:
        """Runs after every reset."""


class Host:
    """One plugin instance's view of the server.

    Attributes:
        name: The instance's name.
        logger: Logs under `mjplug.instance.<name>`.
        model: The compiled model. Fixed for the life of the plugin.
        data: The live state. What `init` caches of its arrays stays valid.
        random: Random numbers of this instance, seeded by `sim.seed` and its name.
        model_file: The model's file; None if it comes from none.

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
    """

    def __init__(
        self,
        name: str,
        loop: Loop,
        transport: Transport,
        resolve: Resolve,
        workers: Workers,
        diagnostics: Diagnostics,
        seed: int = 0,
        disable_on_error: bool = False,
        model_file: Path | None = None,
        folders: Sequence[Path] = (),
        stopwatch: Stopwatch | None = None,
    ) -> None:
        self.name = name
        self.logger = logging.getLogger(f"{INSTANCES}.{name}")
        self.model: mujoco.MjModel = loop.simulation.model
        self.data: mujoco.MjData = loop.simulation.data
        self.random = np.random.default_rng([seed, *name.encode()])
        self.model_file = model_file
        self._folders = tuple(folders)
        self._stopwatch = stopwatch or Stopwatch()
        self._loop = loop
        self._simulation = loop.simulation
        self._transport = transport
        self._resolve = resolve
        self._workers = workers
        self._diagnostics = diagnostics
        self._disable_on_error = disable_on_error
        self._disabled = ""
        self._stepper: Stepper | None = None
        self._sleepers: dict[Publisher[Any], list[Timer]] = {}
        self._holds: list[VelocityHold] = []

    @property
    def step(self) -> int:
        """Steps taken since the server started."""
        return self._simulation.step

    @property
    def epoch(self) -> int:
        """Resets of the world since the server started."""
        return self._simulation.epoch

    @property
    def time_ns(self) -> int:
        """Simulated time [ns]."""
        return self._simulation.time_ns

    @property
    def sensor_time_ns(self) -> int:
        """Simulated time of the state that `data.sensordata` belongs to [ns].

        A step computes the sensors first and integrates last, so after it they are one step older than `qpos`.
        """
        return self._simulation.time.ns(self._simulation.sensor_step)

    @property
    def velocity_override(self) -> NDArray[np.float64]:
        """Shape (nv,); what `update` writes here becomes that DOF's velocity in `qvel` right before the step.

        NaN leaves it to physics; all entries are NaN before the first plugin's update of each step.
        """
        return self._loop.steppers.velocity_override

    def now(self) -> Time:
        """Returns the simulated time as a message, for stamps."""
        return Time.from_ns(self.time_ns)

    def steps_covering(self, duration_ns: int) -> int:
        """Returns the smallest number of steps that together last at least `duration_ns` [ns]."""
        return self._simulation.time.steps_covering(duration_ns)

    def time_of(self, step: int) -> float:
        """Returns the simulated time of a step boundary [s]."""
        return self._simulation.time.seconds(step)

    def body_id(self, name: str) -> int:
        """Returns a body's id.

        Raises:
            UnknownName: The model has no such body; the sentence lists those it has.
        """
        return self._simulation.body_id(name)

    def find_file(self, name: str) -> Path:
        """Returns the file that a parameter names: relative to the configuration file, absolute, or package://pkg/path.

        Raises:
            ModelError: There is none; the sentence says where it was looked for.
        """
        return locate(name, self._folders)

    def kinematics(self) -> None:
        """Makes `xpos`, `xquat`, `xmat` and `xipos` those of the current positions; a step leaves them older."""
        self._simulation.kinematics()

    def forward(self) -> None:
        """Makes everything derived, sensors too, that of the current state; costs about a step."""
        self._simulation.forward()

    def full_name(self, name: str) -> str:
        """Returns the full ROS name of a topic or service as this plugin writes it, after remapping.

        Raises:
            PluginError: The name breaks ROS's rules.
        """
        try:
            return self._resolve(name)
        except NameRuleError as error:
            raise PluginError(str(error)) from error

    def activate(self) -> None:
        """Asks for `update` before every step; costs speed, so ask only while there is something to do."""
        if self._stepper is not None and not self._disabled:
            self._loop.steppers.activate(self._stepper)

    def deactivate(self) -> None:
        """Ends the calls of `update`."""
        if self._stepper is not None:
            self._loop.steppers.deactivate(self._stepper)

    def create_publisher(
        self, type: type[M], name: str, qos: QoS = DEFAULT, on_matched: Callable[[], None] | None = None
    ) -> Publisher[M]:
        """Declares a topic that the plugin publishes.

        Args:
            type: Message class.
            name: `/absolute`, or relative (`name` and `~/name` mean the same) to `/<namespace>/<instance>/`.
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
                self._guarded(on_matched)()

        topic = Topic(self.full_name(name), type, qos)
        publisher = self._transport.open_publisher(topic, lambda: self._loop.inbox.post(appeared))
        self._sleepers[publisher] = sleepers
        return publisher

    def create_subscription(self, type: type[M], name: str, callback: Callable[[M], None], qos: QoS = LATEST) -> None:
        """Declares a topic that the plugin reads; the newest `qos.depth` messages since the last step are delivered.

        Args:
            type: Message class.
            name: As for `create_publisher`.
            callback: Gets each message, already validated against its type.
            qos: Quality of service; the default delivers the newest message only, as commands want it.
        """
        arrivals = count(1)
        newest = [0]

        def deliver(message: M) -> None:
            number = newest[0] = next(arrivals)
            self._loop.inbox.post(lambda: take(number, message))

        def take(number: int, message: M) -> None:
            # Each message keeps its place among the requests; one that newer ones have overtaken is dropped.
            if newest[0] - number < qos.depth and not self._disabled:
                began = perf_counter()
                try:
                    callback(message)
                except Exception:
                    self.logger.exception("a message on %s could not be handled", name)
                self._stopwatch.add(began)

        self._transport.open_subscription(Topic(self.full_name(name), type, qos), deliver)

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
            if self._disabled:
                call.refuse(self._disabled)
            else:
                began = perf_counter()
                self._loop.serve(call, handler, owner=self)
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
            return loop.scheduler.every(steps, self._guarded(callback), simulation.step)
        publishers = tuple(while_matched) if isinstance(while_matched, Sequence) else (while_matched,)
        if any(publisher not in self._sleepers for publisher in publishers):
            raise PluginError("while_matched is no publisher of this plugin")
        timer = loop.scheduler.every(
            steps,
            self._guarded(callback),
            simulation.step,
            wanted=lambda: any(publisher.matched for publisher in publishers),
        )
        for publisher in publishers:
            self._sleepers[publisher].append(timer)
        return timer

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
        self._holds.append(hold)
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
            sync: Whether `submit` waits until the work is done, so that physics runs in lockstep with it.
            on_ready: Gets what `Work.open` said, each time the work has been opened.
            on_done: Gets each job that was performed, and what `perform` returned.
            on_lost: Gets the tasks that will not be performed, and why.
        """
        order = Order(
            self.name,
            work,
            tuple(publishers),
            environments,
            sync,
            self._guarded(on_ready or _nothing),
            self._guarded(on_done or _nothing),
            self._guarded(on_lost or _nothing),
        )
        return self._workers.start(order, self._simulation, self._loop.inbox)

    def create_diagnostic(self, name: str, task: Callable[[], Diagnosis]) -> None:
        """Adds a status to `/diagnostics`, as diagnostic_updater's `add` does.

        Args:
            name: What the status is about; the instance's name is put before it. Empty: the instance itself.
            task: Called about once a second of wall time, and answers what to say.
        """

        def ask() -> Diagnosis:
            return Diagnosis(Level.ERROR, self._disabled) if self._disabled else task()

        self._diagnostics.add(f"{self.name}: {name}" if name else self.name, ask)

    def attach(self, plugin: Stepping) -> None:
        """Binds the plugin's `update` and `on_reset` to the loop. The server calls this once, before `init`."""
        stepper = self._stepper = _PluginStepper(plugin.update, self._guarded(plugin.on_reset), self._fail)
        self._stopwatch.watch(stepper)
        self._loop.steppers.add(stepper)

    def _guarded(self, callback: Callable[P, None]) -> Callable[P, None]:
        """Wraps the plugin's own work, so that its failure is loud and follows the `on_plugin_error` policy."""

        def call(*args: P.args, **kwargs: P.kwargs) -> None:
            if self._disabled:
                return
            began = perf_counter()
            try:
                callback(*args, **kwargs)
            except Exception as error:
                self._fail(error)
            self._stopwatch.add(began)

        return call

    def _fail(self, error: Exception) -> None:
        self.logger.error("plugin %s failed", self.name, exc_info=error)
        self._disabled = f"plugin {self.name} was switched off after an error: {error!r}"
        self.deactivate()
        for hold in self._holds:
            hold.release()
        self._loop.scheduler.close_jobs(self._disabled, owner=self)
        if not self._disable_on_error:
            self._loop.fail(PluginError(f"plugin {self.name} failed: {error!r} (on_plugin_error: stop)"))


class _PluginStepper:
    """A plugin as the loop sees it; `update` is the plugin's own method, since it is called at every step."""

    def __init__(
        self, update: Callable[[], None], on_reset: Callable[[], None], failed: Callable[[Exception], None]
    ) -> None:
        self.update = update
        self.on_reset = on_reset
        self.failed = failed


def _nothing(*_: Any) -> None:
    pass
