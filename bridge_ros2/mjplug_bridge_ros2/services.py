"""Services: a ROS service call becomes a Zenoh query; other calls are not blocked while it waits for the reply.

The callback of a service is a coroutine. While it awaits a future, the executor runs other callbacks. Zenoh's thread
passes the reply to the executor's thread, which completes the future; if Zenoh's thread completed it, some versions of
rclpy would not wake up. The callback group is reentrant, because otherwise each call would wait for the previous one.

Rclpy passes requests and responses as objects only, unlike topic messages, so they are serialised here once more.
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
"""Text of Zenoh's error reply after a timeout."""


@dataclass(frozen=True)
class Outcome:
    """The result of a call.

    Attributes:
        payload: The response in CDR; None if the call failed.
        error: The error message if the call failed.
    """

    payload: bytes | None
    error: str = ""


class ServiceRelay:
    """A service of the server.

    Args:
        node: The ROS node that provides the service.
        handover: Calls functions on the thread of the node.
        session: The session for the queries.
        entry: The service of the server.
        ros_name: Its name in ROS.
        service_type: Its ROS class.
        timeout: Timeout of a call [s].
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
        self._close_reason = ""
        self._service = node.create_service(
            service_type, ros_name, self._serve, callback_group=ReentrantCallbackGroup()
        )

    def poll(self) -> None:
        """Does nothing: a service does not depend on the number of clients."""

    def close(self, reason: str) -> None:
        """Fails the waiting calls, and destroys the service after their responses were sent.

        Args:
            reason: The reason, for the error messages.
        """
        self._close_reason = reason
        for future in tuple(self._waiting):
            self._finish(future, Outcome(None, reason))
        if not self._waiting:
            self._node.destroy_service(self._service)

    async def _serve(self, request: Any, response: Any) -> Any:
        if self._close_reason:
            return self._failed(response, self._close_reason)
        future = Future()
        self._waiting.add(future)
        try:
            self._query(serialize_message(request), future)
            outcome = await future
        finally:
            self._waiting.discard(future)
            self._destroy_if_unused()
        if outcome.payload is None:
            return self._failed(response, outcome.error)
        try:
            return deserialize_message(outcome.payload, self._type.Response)
        except Exception as error:
            # The exception type depends on the RMW.
            return self._failed(response, f"the response of the server cannot be read: {error}")

    def _destroy_if_unused(self) -> None:
        """Destroys a closed service after the response of its last call was sent."""
        if self._close_reason and not self._waiting:
            self._handover.call(self._node.destroy_service, self._service)

    def _query(self, payload: bytes, future: Any) -> None:
        def answered(reply: zenoh.Reply) -> None:
            self._handover.call(self._finish, future, self._outcome(reply))

        def ended() -> None:
            missing = Outcome(None, f"the server did not answer on {self._entry.key}")
            self._handover.call(self._finish, future, missing)

        handler = Callback(answered, drop=ended, indirect=False)
        try:
            self._session.get(self._entry.key, handler, payload=payload, encoding=self._encoding, timeout=self._timeout)
        except zenoh.ZError as error:
            self._finish(future, Outcome(None, f"the query to the server failed: {plain(error)}"))

    def _outcome(self, reply: zenoh.Reply) -> Outcome:
        if reply.ok is not None:
            return Outcome(reply.ok.payload.to_bytes())
        assert reply.err is not None
        message = reply.err.payload.to_bytes().decode(errors="replace")
        if message == _ZENOH_TIMEOUT:
            message = f"the server did not answer within {self._timeout:g} s"
        return Outcome(None, message)

    def _finish(self, future: Any, outcome: Outcome) -> None:
        if not future.done():
            future.set_result(outcome)

    def _failed(self, response: Any, message: str) -> Any:
        reported = fill_in(response, message)
        rest = "" if reported else "; the response type has no field for errors, so the client got default values"
        self._node.get_logger().error(f"{self._name}: {message}{rest}")
        return response
