"""Services: a call from ROS becomes a Zenoh query, and nothing waits for its reply but the call itself.

The callback of a service is a coroutine. While it awaits a future, the executor does other things. Zenoh's thread hands
the reply over to the executor's, which completes the future; if Zenoh's completed it, some versions of rclpy would not
wake up. The callback group has to be reentrant, or each call would wait for the one before.

Rclpy has requests and responses as objects only, unlike messages of topics. So each is serialised once more here.
"""

from dataclasses import dataclass
from typing import Any

import zenoh
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.serialization import deserialize_message, serialize_message
from rclpy.task import Future
from zenoh.handlers import Callback

from mjplug_bridge_ros2.failure import fill_in
from mjplug_bridge_ros2.handover import Handover
from mjplug_bridge_ros2.listing import ServiceEntry
from mjplug_bridge_ros2.session import plain

_ZENOH_TIMEOUT = "Timeout"
"""What Zenoh's own error reply says."""


@dataclass(frozen=True)
class Outcome:
    """How a call ended.

    Attributes:
        payload: The response in CDR; None if there is none.
        error: What went wrong, if there is none.
    """

    payload: bytes | None
    error: str = ""


class ServiceRelay:
    """A service of the server.

    Args:
        node: The node to offer it with.
        handover: The way to the thread of the node.
        session: The session to ask the server with.
        entry: The service.
        ros_name: What it is called in ROS.
        service_type: Its class.
        timeout: How long a call may take [s].
    """

    def __init__(
        self,
        node: Any,
        handover: Handover,
        session: zenoh.Session,
        entry: ServiceEntry,
        ros_name: str,
        service_type: Any,
        timeout: float,
    ) -> None:
        self._node = node
        self._handover = handover
        self._session = session
        self._entry = entry
        self._name = ros_name
        self._type = service_type
        self._timeout = timeout
        self._encoding = zenoh.Encoding.APPLICATION_CDR.with_schema(entry.type)
        self._waiting: set[Any] = set()
        self._closed_because = ""
        self._service = node.create_service(
            service_type, ros_name, self._serve, callback_group=ReentrantCallbackGroup()
        )

    def poll(self) -> None:
        """Does nothing: a service is needed whether somebody calls it or not."""

    def close(self, reason: str) -> None:
        """Fails the calls that wait, and takes the service away when they have been answered.

        Args:
            reason: Why, for the clients.
        """
        self._closed_because = reason
        for future in tuple(self._waiting):
            self._finish(future, Outcome(None, reason))
        if not self._waiting:
            self._node.destroy_service(self._service)

    async def _serve(self, request: Any, response: Any) -> Any:
        if self._closed_because:
            return self._failed(response, self._closed_because)
        future = Future()
        self._waiting.add(future)
        try:
            self._ask(serialize_message(request), future)
            outcome = await future
        finally:
            self._waiting.discard(future)
            self._leave()
        if outcome.payload is None:
            return self._failed(response, outcome.error)
        try:
            return deserialize_message(outcome.payload, self._type.Response)
        except Exception as error:
            # Each RMW has exceptions of its own for this.
            return self._failed(response, f"the response of the server cannot be read: {error}")

    def _leave(self) -> None:
        """After the last call of a service that is closed: takes it away, once the response has been sent."""
        if self._closed_because and not self._waiting:
            self._handover.call(self._node.destroy_service, self._service)

    def _ask(self, payload: bytes, future: Any) -> None:
        def answered(reply: zenoh.Reply) -> None:
            self._handover.call(self._finish, future, self._outcome(reply))

        def ended() -> None:
            missing = Outcome(None, f"the server did not answer on {self._entry.key}")
            self._handover.call(self._finish, future, missing)

        handler = Callback(answered, drop=ended, indirect=False)
        try:
            self._session.get(self._entry.key, handler, payload=payload, encoding=self._encoding, timeout=self._timeout)
        except zenoh.ZError as error:
            self._finish(future, Outcome(None, f"the server cannot be asked: {plain(error)}"))

    def _outcome(self, reply: zenoh.Reply) -> Outcome:
        if reply.ok is not None:
            return Outcome(reply.ok.payload.to_bytes())
        assert reply.err is not None
        sentence = reply.err.payload.to_bytes().decode(errors="replace")
        if sentence == _ZENOH_TIMEOUT:
            sentence = f"the server did not answer within {self._timeout:g} s"
        return Outcome(None, sentence)

    def _finish(self, future: Any, outcome: Outcome) -> None:
        if not future.done():
            future.set_result(outcome)

    def _failed(self, response: Any, sentence: str) -> Any:
        told = fill_in(response, sentence)
        rest = "" if told else "; the type of the response cannot say so, and the client got its initial values"
        self._node.get_logger().error(f"{self._name}: {sentence}{rest}")
        return response
