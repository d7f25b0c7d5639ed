"""The part of the host that corresponds to a ROS node: names, topics, services and timers. Physics thread only."""

from collections.abc import Callable, Sequence
from pathlib import Path
from time import perf_counter
from typing import Any, TypeVar

from mjplug.contracts.actions import ActionName, ActionTransport
from mjplug.contracts.topics import PublishedTopic, ReadTopic, Sampler, Topics
from mjplug.contracts.transport import DEFAULT, LATEST, Call, Publisher, QoS, ServiceName, Topic
from mjplug.errors import PluginError, RequestError
from mjplug.log import INSTANCES
from mjplug.log_scope import logger_of_server
from mjplug.physics.loop import WALL_TIMER_PERIOD, Loop
from mjplug.physics.scheduler import Alarm, Slow, Timer
from mjplug.plugin.action_server import ActionServer, GoalHandler
from mjplug.plugin.arrivals import Arrivals
from mjplug.plugin.endpoints import NOT_IN_MODEL, Endpoints, PublishedEndpoint, ReadEndpoint, ServedEndpoint
from mjplug.plugin.guard import Guard
from mjplug.plugin.prepared import Prepare, Prepared
from mjplug.plugin.stopwatch import Stopwatch
from mjplug.plugin.world_view import WorldView
from mjplug.throttle import Throttle
from mjplug_schemas.action import Action
from mjplug_schemas.errors import NameRuleError
from mjplug_schemas.message import Message, Service

M = TypeVar("M", bound=Message)

Resolve = Callable[[str], str]
"""Converts a name as a plugin writes it to the full ROS name."""

REFUSAL_LOG_INTERVAL = 1.0
"""Minimum wall time between two log lines about refused messages of one topic [s]."""


class NodeView(WorldView):
    """The server as a ROS node of one plugin instance. The methods have the names of the methods of a ROS node.

    Callbacks run on the physics thread, between two steps, under the instance's `Guard`: it measures their time and
    handles their exceptions.

    Attributes:
        name: The instance's name.
        logger: Logger of the instance, named `mjplug.instance.<name>`.

    Args:
        name: The instance's name.
        loop: The physics loop.
        transport: Declares topics and services.
        resolve: Converts names of topics and services to full ROS names.
        disable_on_error: Whether an exception in the plugin disables the instance instead of stopping the server.
        model_file: The model's file.
        folders: Folders in which relative file names of parameters are searched, in this order.
        stopwatch: Measures the time that the plugin takes.
        frame_prefix: Prefix of the TF frames in the plugin's messages, such as `robot1/`.
        topics: Where topics are registered for step requests.
    """

    def __init__(
        self,
        name: str,
        loop: Loop,
        transport: ActionTransport,
        resolve: Resolve,
        disable_on_error: bool,
        model_file: Path | None,
        folders: Sequence[Path],
        stopwatch: Stopwatch,
        frame_prefix: str,
        topics: Topics,
    ) -> None:
        super().__init__(loop.simulation, model_file, folders)
        self.name = name
        self.logger = logger_of_server(f"{INSTANCES}.{name}")
        self._loop = loop
        self._transport = transport
        self._resolve = resolve
        self._frame_prefix = frame_prefix
        self._stopwatch = stopwatch
        self._topics = topics
        self._guard = Guard(name, self.logger, loop, stopwatch, disable_on_error)
        self._endpoints = Endpoints()
        self._alarms: list[Alarm] = []
        self._wall_checks: list[Callable[[float], None]] = []
        self._published: dict[Publisher[Any], PublishedTopic] = {}
        # The timers that sleep while none of their publishers has a subscriber.
        self._timers_by_publisher: dict[Publisher[Any], list[Timer]] = {}

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

    def create_publisher(
        self,
        type: type[M],
        name: str,
        qos: QoS = DEFAULT,
        on_matched: Callable[[], None] | None = None,
        sample: Sampler | None = None,
    ) -> Publisher[M]:
        """Declares a topic that the plugin publishes, and returns its publisher.

        Args:
            type: Message class.
            name: `/absolute`; `{ns}/name`, which is `/<namespace>/name`; or relative (`name` and `~/name` mean the
                same) to `/<namespace>/<instance>/`.
            qos: Quality of service.
            on_matched: Called each time the first subscriber appears.
            sample: Returns the message, or its frame, for the present state, without other effects. Clients that step
                the simulation with `~/step` get it as the sample of the topic after their last step. Without it, they
                get the newest message that was published during their steps.

        Raises:
            PluginError: The name is not a valid ROS name.
        """
        topic = Topic(self.full_name(name), type, qos)
        endpoint = self._endpoints.take(("publisher", topic), PublishedEndpoint)
        if endpoint is None:
            endpoint = self._open_publisher(topic)
            self._endpoints.add(("publisher", topic), endpoint)
        endpoint.on_matched = None if on_matched is None else self._guard.guarded(on_matched)
        endpoint.published.sample = sample
        return endpoint.publisher

    def _open_publisher(self, topic: Topic[Any]) -> PublishedEndpoint:
        endpoint, inbox = PublishedEndpoint(self._loop.scheduler, lambda: self.step), self._loop.inbox
        publisher = self._transport.open_publisher(topic, lambda: inbox.post(endpoint.matched))
        published = PublishedTopic(topic, publisher, None, endpoint.matched, lambda: self.step)
        endpoint.publisher, endpoint.published = publisher, published
        self._timers_by_publisher[publisher] = endpoint.timers
        self._topics.published.setdefault(topic.name, []).append(published)
        self._published[publisher] = published
        return endpoint

    def create_subscription(
        self,
        type: type[M],
        name: str,
        callback: Callable[[Any], None],
        qos: QoS = LATEST,
        prepare: Prepare | None = None,
    ) -> None:
        """Subscribes to a topic. The newest `qos.depth` messages since the last step are delivered.

        Args:
            type: Message class.
            name: As for `create_publisher`.
            callback: Called with each message, after the message was validated against its type. To refuse a message,
                raise RequestError; its text is logged at most once a second. For any other exception, the
                `on_plugin_error` policy applies.
            qos: Quality of service. The default delivers only the newest message, which suits commands.
            prepare: Called with each message on another thread, while physics runs, so it must use only data that do
                not change. `callback` gets what it returns. An exception has the same effect as one of `callback`.

        Raises:
            PluginError: The name is not a valid ROS name.
        """
        topic = Topic(self.full_name(name), type, qos)
        endpoint = self._endpoints.take(("subscription", topic), ReadEndpoint)
        if endpoint is None:
            endpoint = self._open_subscription(topic)
            self._endpoints.add(("subscription", topic), endpoint)
        endpoint.callback, endpoint.prepare = callback, prepare

    def _open_subscription(self, topic: Topic[Any]) -> ReadEndpoint:
        endpoint, refusals = ReadEndpoint(), Throttle(REFUSAL_LOG_INTERVAL)

        def take(message: Any) -> None:
            if endpoint.callback is None:
                return
            try:
                endpoint.callback(message.get(endpoint.prepare) if isinstance(message, Prepared) else message)
            except RequestError as error:
                if refusals.admit(perf_counter()):
                    self.logger.warning(
                        "topic %s: a message was refused: %s%s", topic.name, error, refusals.suppressed()
                    )

        arrivals = Arrivals(topic.name, topic.qos.depth, self._loop.inbox, self._guard.guarded(take))

        def deliver(message: Any) -> None:
            prepare = endpoint.prepare
            arrivals.deliver(message if prepare is None else Prepared(prepare, message))

        def handle(message: Any) -> None:
            if endpoint.callback is None:
                raise RequestError(NOT_IN_MODEL)
            endpoint.callback(message if endpoint.prepare is None else endpoint.prepare(message))

        self._transport.open_subscription(topic, deliver)
        self._topics.read.setdefault(topic.name, []).append(ReadTopic(topic, self._guard.checked(handle)))
        return endpoint

    def create_service(
        self,
        type: type[Service],
        name: str,
        handler: Callable[[Any, Call], Message | Slow],
        packed: bool = False,
    ) -> None:
        """Declares a service.

        Args:
            type: Service class.
            name: As for `create_publisher`.
            handler: Called with the request and the call. It returns the response, or it is a generator that yields the
                step numbers or events that it waits for and returns the response. The generator's `finally` blocks run
                on completion, reset and shutdown. To refuse the request, raise RequestError before anything is applied.
                A generator may respond early with `call.respond(…)`.
            packed: Whether sequences of numbers in CDR requests are read-only memoryviews instead of tuples, which
                saves time if a request contains thousands of numbers. In JSON requests they are tuples.

        Raises:
            PluginError: The name is not a valid ROS name.
        """
        service = ServiceName(self.full_name(name), type, packed)
        endpoint = self._endpoints.take(("service", service), ServedEndpoint)
        if endpoint is None:
            endpoint = self._open_service(service)
            self._endpoints.add(("service", service), endpoint)
        endpoint.handler = handler

    def _open_service(self, service: ServiceName) -> ServedEndpoint:
        endpoint = ServedEndpoint()

        def serve(call: Call) -> None:
            if self._guard.disabled:
                call.refuse(self._guard.disabled)
            elif endpoint.handler is None:
                call.refuse(NOT_IN_MODEL)
            else:
                began = perf_counter()
                self._loop.serve(call, endpoint.handler, owner=self._guard)
                self._stopwatch.add(began)

        self._transport.open_service(service, lambda call: self._loop.inbox.post(lambda: serve(call)))
        return endpoint

    def create_action(
        self,
        type: type[Action],
        name: str,
        handler: GoalHandler,
        on_abort: Callable[[str], Message] | None = None,
        prepare: Prepare | None = None,
    ) -> ActionServer:
        """Declares an action.

        Args:
            type: Action class.
            name: As for `create_publisher`.
            handler: Called with the request and its `Goal`, through which it publishes feedback. It returns the
                result, or it is a generator that yields the step numbers or events that it waits for and returns the
                result.

                To reject the goal, raise RequestError before the first wait and before anything is applied. A
                RequestError after the first wait aborts the goal with this reason. To choose the outcome, return
                `goal.succeeded(result)`, `goal.aborted(result)` or `goal.canceled(result)`.

                When a client cancels the goal, GoalCanceled is raised where the generator waits. If it is not caught,
                the goal is cancelled with a result with default values. The generator may catch it, wait for more
                steps, and return a result. `finally` blocks run on completion, cancellation, reset and shutdown.
            on_abort: Makes the result of a goal that the server aborts, from the reason: after a reset, a restored
                state, a failure of the handler, and at the end. By default, a text field of the result, such as
                `error_string`, contains the reason.
            prepare: Called with each request on another thread, while physics runs, so it must use only data that do
                not change. `handler` gets what it returns. A RequestError rejects the goal.

        Raises:
            PluginError: The name is not a valid ROS name.
        """
        action = ActionName(self.full_name(name), type)
        server = self._endpoints.take(("action", action), ActionServer)
        if server is not None:
            server.use(handler, on_abort, prepare)
            return server
        server = ActionServer(
            self._loop,
            self._transport,
            action,
            handler,
            self.now,
            self.logger,
            self._guard,
            lambda: self._guard.disabled,
            on_abort,
            prepare,
        )
        self._endpoints.add(("action", action), server)
        return server

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
            return self._guard.add_timer(loop.scheduler.every(steps, self._guard.guarded(callback), simulation.step))
        publishers = tuple(while_matched) if isinstance(while_matched, Sequence) else (while_matched,)
        if any(publisher not in self._timers_by_publisher for publisher in publishers):
            raise PluginError("while_matched contains an object that is not a publisher of this plugin")
        timer = loop.scheduler.every(
            steps,
            self._guard.guarded(callback),
            simulation.step,
            while_true=lambda: any(publisher.matched for publisher in publishers),
        )
        self._guard.add_timer(timer)
        for publisher in publishers:
            self._timers_by_publisher[publisher].append(timer)
        return timer

    def create_alarm(self, callback: Callable[[], None]) -> Alarm:
        """Calls a function once at a step, before the updates of that step: `alarm.set(host.step + 10)`.

        The alarm is off until it is set. Neither a reset nor a restored state changes it; call `set` or `stop` in
        `on_reset` and `restore`.

        Args:
            callback: Called on the physics thread.
        """
        alarm = self._loop.scheduler.alarm(self._guard.guarded(callback))
        self._alarms.append(alarm)
        return alarm

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
                # Half a check earlier, so that a check that comes slightly early is not missed.
                due = now + period - 0.5 * WALL_TIMER_PERIOD
                guarded()

        self._loop.on_second.append(check)
        self._wall_checks.append(check)

    def _release(self) -> None:
        """Releases what the plugin has created, before it is restarted; endpoints stay for `init`."""
        self._endpoints.release_all()
        for alarm in self._alarms:
            self._loop.scheduler.remove(alarm)
        for check in self._wall_checks:
            self._loop.on_second.remove(check)
        self._alarms.clear()
        self._wall_checks.clear()
