"""A connection to the servers of one network."""

import atexit
import threading
from collections.abc import Callable, Mapping, Sequence
from types import TracebackType
from typing import TYPE_CHECKING, Any, TypeVar, overload
from urllib.parse import quote
from uuid import UUID

import zenoh

from mjplug.client import request
from mjplug.client.confirmation import await_publishers
from mjplug.client.errors import ClientError, TimedOutError, WrongTypeError
from mjplug.client.goal import Goal
from mjplug.client.graph import GIVE_TYPE, Graph
from mjplug.client.parameters import read as read_parameters
from mjplug.client.publisher import Publisher
from mjplug.client.states import StateCalls
from mjplug.client.subscription import Subscription
from mjplug.client.timeouts import bounded
from mjplug.client.types import Fields, as_message, find, known, message_class
from mjplug.wire.discovery.format import ServiceInfo, TopicInfo
from mjplug_schemas import names
from mjplug_schemas.message import Message
from mjplug_schemas.mujoco_ros2_control_msgs import StepSimulation

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from mjplug.client.driver import Arrays, StepResult
    from mjplug.client.wire_driver import WireDriver

M = TypeVar("M")


class Client(Graph, StateCalls):
    """Subscribes to topics, publishes messages, calls services and sends goals, on one network. Thread-safe.

    Names follow the rules of ROS: `clock` means `/clock`, and `~/set_pause` means `/mjplug/set_pause`.
    A client may be created before the topics and services it uses exist.

    Args:
        session: An open session, which the client closes.
        endpoint: As above.
        server: The name of the server to use for `~`; if empty, there must be only one server.
    """

    def __init__(self, session: zenoh.Session, endpoint: str, server: str = "") -> None:
        super().__init__(session, endpoint, server)
        # Protects the collections below; never held while waiting for a server. If Ctrl-C interrupts a thread that
        # holds it, this thread can still close the client.
        self._lock = threading.RLock()
        self._publishers: dict[tuple[str, type[Any]], Publisher[Any]] = {}
        self._subscriptions: list[Subscription[Any]] = []
        self._called: dict[str, ServiceInfo] = {}
        self._driver: WireDriver | None = None
        # If a program does not close the client, Zenoh's threads may otherwise keep the process alive.
        atexit.register(self._close_at_exit)

    @overload
    def subscribe(
        self,
        name: str,
        type: None = None,
        callback: Callable[[Any], None] | None = None,
        *,
        depth: int = 10,
        history: int | None = None,
    ) -> Subscription[Any]: ...

    @overload
    def subscribe(
        self,
        name: str,
        type: str,
        callback: Callable[[Any], None] | None = None,
        *,
        depth: int = 10,
        history: int | None = None,
    ) -> Subscription[Any]: ...

    @overload
    def subscribe(
        self,
        name: str,
        type: type[M],
        callback: Callable[[M], None] | None = None,
        *,
        depth: int = 10,
        history: int | None = None,
    ) -> Subscription[M]: ...

    def subscribe(
        self,
        name: str,
        type: Any = None,
        callback: Callable[[Any], None] | None = None,
        *,
        depth: int = 10,
        history: int | None = None,
    ) -> Subscription[Any]:
        """Subscribes to a topic. A latched topic delivers its last messages at once.

        When it returns, the publishers of the topic have matched this subscriber, so all later messages arrive.

        Args:
            name: The topic.
            type: The message class, or the name of the type; None asks the server. With `dict`, messages of any type
                are nested dictionaries; with `bytes`, they are CDR data.
            callback: Called with each message, on its own thread. Without it, iterate, or call `next` or `latest`.
            depth: Maximum number of messages that wait to be taken; 1 keeps only the newest.
            history: How many earlier messages to request; None requests as many as a latched topic keeps, and none
                from other topics.

        Raises:
            UnknownNameError: No server has the topic, and no type is given.
            WrongTypeError: The topic has another type, or `mjplug_schemas` has no class for its type.
        """
        full, topic, kind = self._choose(name, type, raw=True)
        subscription: Subscription[Any] = Subscription(full, kind, depth, callback)
        key = f"{names.key(full)}/@json" if kind is dict else names.key(full)
        # A callback of the subscription may close the client.
        session = self.session
        with self._lock:
            kept = topic.depth if topic is not None and topic.latched else 0
            subscription.open(session, key, kept if history is None else history)
            self._subscriptions = [*(s for s in self._subscriptions if not s.closed), subscription]
        if topic is not None and not topic.latched:
            await_publishers(session, topic.publishers, key)
        return subscription

    def publisher(self, name: str, type: Any = None) -> Publisher[Any]:
        """Creates a publisher; the topic needs no subscribers yet.

        Args:
            name: The topic.
            type: The message class, or the name of the type; None asks the server.

        Raises:
            UnknownNameError: No server has the topic, and no type is given.
            WrongTypeError: The topic has another type.
        """
        full, _, kind = self._choose(name, type)
        with self._lock:
            publisher = self._publishers.get((full, kind))
            if publisher is None or publisher.closed:
                publisher = self._publishers[full, kind] = Publisher(self.session, full, names.key(full), kind)
        return publisher

    def publish(self, name: str, message: Message | Fields, timeout: float = 5.0) -> None:
        """Publishes one message as soon as the topic has a subscriber.

        Args:
            name: The topic.
            message: The message, or nested dictionaries of its fields.
            timeout: How long to wait for a subscriber [s].

        Raises:
            TimedOutError: The topic got no subscriber in time.
            UnknownNameError: No server has the topic, and `message` is a dictionary.
            WrongTypeError: The message is not of the topic's type.
        """
        kind = type(message) if isinstance(message, Message) else known(self.topic(name).type) or dict
        publisher = self.publisher(name, kind)
        if not publisher.wait_for_subscriber(timeout):
            raise TimedOutError(f"no subscriber for {publisher.name} within {timeout:g} s")
        publisher.publish(message)

    def call(
        self,
        name: str,
        message: Message | Fields | None = None,
        *,
        timeout: float | None = None,
        check: bool = True,
        **fields: Any,
    ) -> Any:
        """Calls a service and waits for its response.

        Args:
            name: The service.
            message: The request, or nested dictionaries of its fields; missing fields have their initial values.
            timeout: How long to wait [s]; None is the expected duration of the request plus 10 s.
            check: Whether to raise an error if `success` is false in the response.
            **fields: The fields of the request, instead of `message`.

        Raises:
            RequestRefused: The response is an error or, with `check`, contains `success: false`.
            TimedOutError: No response arrived in time.
            UnknownNameError: No server offers the service.
            WrongTypeError: The request has another type than the service, or is given twice.
        """
        if message is not None and fields:
            raise WrongTypeError(f"the request is given twice: as a message, and as {', '.join(fields)}")
        return self._send(name, fields if message is None else message, timeout, check)

    def _call_with(self, parameters: Mapping[str, str], name: str, request: Message, timeout: float | None) -> Any:
        text = ";".join(f"{key}={quote(value)}" for key, value in parameters.items())
        return self._send(name, request, timeout, True, text)

    def _send(self, name: str, given: Any, timeout: float | None, check: bool, parameters: str = "") -> Any:
        service = self._called.get(name) or self.service(name)
        kind = known(service.type)
        sent = given if kind is None else as_message(given, kind.Request)
        limit = request.default_timeout(sent, self._speed(service, sent)) if timeout is None else bounded(timeout)
        try:
            response = request.send(self.session, service, sent, kind, limit, parameters)
            # A lookup takes longer than a call.
            self._called[name] = service
        except TimedOutError as error:
            self._called.pop(name, None)
            raise TimedOutError(f"{error}{self._excuse(service, sent)}") from None
        if check:
            request.check(service, response)
        return response

    def send_goal(
        self,
        name: str,
        goal: Message | Fields | None = None,
        *,
        callback: Callable[[Any], None] | None = None,
        depth: int = 1000,
        timeout: float = request.MARGIN,
        **fields: Any,
    ) -> Goal:
        """Sends a goal to an action, and waits until the server has accepted it.

        Args:
            name: The action.
            goal: The goal, or nested dictionaries of its fields; missing fields have their initial values.
            callback: Called with each feedback, on Zenoh's thread. Without it, iterate over the returned `Goal`.
            depth: Maximum number of feedback messages that wait to be taken.
            timeout: How long to wait until the goal is accepted [s].
            **fields: The fields of the goal, instead of `goal`.

        Returns:
            The goal: iterate over it to get the feedback, and call `result` or `cancel`.

        Raises:
            RequestRefused: The server rejects the goal.
            TimedOutError: There was no answer in time.
            UnknownNameError: No server offers the action.
            WrongTypeError: The goal has another type than the action, or is given twice.
        """
        if goal is not None and fields:
            raise WrongTypeError(f"the goal is given twice: as a message, and as {', '.join(fields)}")
        action = self.action(name)
        kind = known(action.type)
        given = fields if goal is None else goal
        sent = Goal(action, kind, depth, self._cancel_goal, callback)
        sent.send(self.session, given if kind is None else as_message(given, kind.Goal), bounded(timeout))
        return sent

    def _cancel_goal(self, goal: Goal) -> Any:
        info = {"goal_id": {"uuid": UUID(goal.id).bytes}}
        return self.call(f"{goal.action}/_action/cancel_goal", {"goal_info": info})

    def step(
        self,
        n: int = 1,
        ctrl: "ArrayLike | None" = None,
        inputs: Mapping[str, Any] | None = None,
        observe: Sequence[str] = ("qpos", "qvel"),
        outputs: Sequence[str] = (),
        timeout: float | None = None,
    ) -> "StepResult":
        """Takes steps of the paused server `~`, in one request. Needs numpy.

        From its first step on, only this client can step the server, until it calls `release` or is closed.

        Args:
            n: Number of physics steps for each action; 0 takes no step.
            ctrl: Controls, shape (nu,); or (k, nu) for k actions, which are applied one after the other for `n` steps
                each. None keeps the present controls.
            inputs: Messages that the server handles before the first step, by topic: a message, nested dictionaries of
                its fields, or a list of them.
            observe: Arrays of mjData to return after each action.
            outputs: Topics whose message after the last step is returned.
            timeout: How long to wait [s]; None is 1 ms per step plus 10 s.

        Returns:
            The observed arrays: `result["qpos"]` has the shape that it has in MuJoCo, with one more dimension of
            length k in front if `ctrl` has two dimensions; and `result.message(topic)`.

        Raises:
            RequestRefused: The server refuses the request, or could not take all steps; the reason says how many.
            TimedOutError: No response arrived in time.
            WrongTypeError: An argument has the wrong shape, or an input the wrong type.
        """
        return self._stepping().step(n, ctrl, inputs, observe, outputs, timeout)

    def rollout(
        self,
        actions: "ArrayLike",
        n: int = 1,
        inputs: Mapping[str, Any] | None = None,
        observe: Sequence[str] = ("qpos", "qvel"),
        outputs: Sequence[str] = (),
        timeout: float | None = None,
    ) -> "StepResult":
        """Takes steps with one row of `actions`, shape (k, nu), after the other, in one request.

        The arguments, results and errors are those of `step`.
        """
        return self._stepping().rollout(actions, n, inputs, observe, outputs, timeout)

    def simulate(
        self,
        actions: "ArrayLike",
        n: int = 1,
        state: str = "",
        observe: Sequence[str] = ("qpos", "qvel"),
        file: bool = False,
        timeout: float | None = None,
    ) -> "Arrays":
        """Simulates sequences of actions in copies of the state, on several threads. The server itself does not step.

        Only MuJoCo takes these steps: plugins neither act nor publish.

        Args:
            actions: Controls of B sequences of k actions, shape (B, k, nu).
            n: Number of physics steps for each action.
            state: Saved state to start from; empty for the present state.
            observe: Arrays to return after each action: `qpos`, `qvel`, `act` and `sensordata`.
            file: Whether the saved state is in a file.
            timeout: How long to wait [s]; None is 1 ms per step plus 10 s.

        Returns:
            The observed arrays by name, each with the shape (B, k, ...).

        Raises:
            RequestRefused: The server refuses the request.
            TimedOutError: No response arrived in time.
            WrongTypeError: An argument has the wrong shape.
        """
        return self._stepping().simulate(actions, n, state, observe, file, timeout)

    def release(self) -> None:
        """Lets other clients step the server; the next `step` owns it again."""
        if self._driver is not None:
            self._driver.release()

    def close(self) -> None:
        """Closes all subscriptions and publishers and the session; a second call does nothing.

        Raises:
            ClientError: Zenoh could not close the session.
        """
        with self._lock:
            if self._closed:
                return
            # From now on, new subscriptions and publishers are refused.
            self._closed = True
        for subscription in self._subscriptions:
            subscription.close()
        for publisher in self._publishers.values():
            publisher.close()
        self._close_session()

    def _close_session(self) -> None:
        try:
            self._session.close()  # type: ignore[no-untyped-call]
        except zenoh.ZError as error:
            atexit.unregister(self._close_at_exit)
            raise ClientError(f"the session with {self.endpoint} could not be closed: {error}") from error
        atexit.unregister(self._close_at_exit)

    def _close_at_exit(self) -> None:
        self.close()
        # Ctrl-C may have interrupted an earlier call.
        if not self._session.is_closed():
            self._close_session()

    def __enter__(self) -> "Client":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            self.close()
        except ClientError as failure:
            if error is None:
                raise
            # The error in the block is more important, and Ctrl-C ends a program without a message.
            error.add_note(str(failure))

    def _service_called(self, name: str) -> ServiceInfo:
        """Returns the entry of a service, from an earlier call if there was one, because a lookup takes longer."""
        service = self._called.get(name)
        if service is None:
            service = self._called[name] = self.service(name)
        return service

    def _stepping(self) -> "WireDriver":
        if self._driver is None:
            # Imported when it is used, because it needs numpy, and the rest of the client does not.
            from mjplug.client.wire_driver import WireDriver  # noqa: PLC0415

            self._driver = WireDriver(self, self._service_called)
        return self._driver

    def _choose(self, name: str, kind: Any, raw: bool = False) -> tuple[str, TopicInfo | None, Any]:
        """Returns the full name of a topic, its entry in the lists of servers, and the message class.

        Args:
            name: The topic.
            kind: The class, or the name of a type, or None.
            raw: Whether the class may be `bytes`.
        """
        full = self.resolve(name)
        topics, silent = self._topics_for(full)
        topic = topics.get(full)
        if kind is None:
            topic = self._known("topic", full, topics, silent, GIVE_TYPE)
            try:
                return full, topic, find(topic.type)
            except WrongTypeError as error:
                raise WrongTypeError(f"topic {full}: {error}; use `dict` to read it") from None
        chosen: Any = bytes if raw and kind is bytes else message_class(kind)
        if topic is not None and chosen not in (bytes, dict) and topic.type != chosen.TYPE:
            raise WrongTypeError(f"topic {full} is {topic.type}, not {chosen.TYPE}")
        return full, topic, chosen

    def _speed(self, service: ServiceInfo, sent: Any) -> float:
        """Returns the speed of a service's server if the request takes simulated time."""
        if request.simulated_time(sent) == 0.0:
            return 1.0
        speed = read_parameters(self.session, service.server).get("sim.speed")
        return float(speed) if isinstance(speed, int | float) else 1.0

    def _excuse(self, service: ServiceInfo, sent: Any) -> str:
        if read_parameters(self.session, service.server).get("sim.paused") is not True:
            return ""
        if isinstance(sent, StepSimulation.Request):
            # The server reports `paused` while it takes the steps.
            return "; the server still takes the steps, until `mjplug sim pause` or ~/set_pause cancels them"
        return "; the simulation is paused"
