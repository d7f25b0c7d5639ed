"""Goals of actions: feedback as it arrives, cancellation and the result."""

import json
import logging
import queue
import uuid
from collections.abc import Callable, Iterator
from typing import Any, Final

import zenoh
from zenoh.handlers import Callback

from mjplug.client.errors import ClientError, GoalFailed, RequestRefused, TimedOutError, WrongTypeError
from mjplug.client.timeouts import bounded
from mjplug.client.types import to_json
from mjplug.wire.discovery.announced import AT_ONCE
from mjplug.wire.discovery.format import ActionInfo
from mjplug.wire.encoding import encoding_of
from mjplug_schemas.action import Action
from mjplug_schemas.errors import CodecError
from mjplug_schemas.message import Message

_log = logging.getLogger(__name__)

STATUS: Final = {4: "SUCCEEDED", 5: "CANCELED", 6: "ABORTED"}
"""Names of the states of a goal that has ended, by the constants of `action_msgs/msg/GoalStatus`."""

_SUCCEEDED = 4

_REASONS = ("error_string", "error_message", "message", "status_message", "reason")
"""Names of the text field of a result that contains the reason for a failure."""


class Goal:
    """A goal that a server has accepted. Thread-safe.

    Attributes:
        action: The action's full name.
        id: The identifier of the goal, a UUID as text.
        dropped: Number of feedback messages that were dropped, because nobody read them.

    Args:
        action: The action.
        kind: The action's class; None exchanges JSON.
        depth: Maximum number of feedback messages that wait to be taken.
        cancel: Calls the service that cancels the goal, and returns the response.
        callback: Called with each feedback, on Zenoh's thread; then there is no other way to read it.
    """

    def __init__(
        self,
        action: ActionInfo,
        kind: type[Action] | None,
        depth: int,
        cancel: Callable[["Goal"], Any],
        callback: Callable[[Any], None] | None = None,
    ) -> None:
        self.action = action.name
        self.id = str(uuid.uuid4())
        self.dropped = 0
        self._info = action
        self._kind = kind
        self._depth = depth
        self._call_cancel = cancel
        self._callback = callback
        self._finished = False
        # Queues, because a wait for them can be interrupted at any time. The last element of each stays in it.
        self._accepted: queue.SimpleQueue[Exception | None] = queue.SimpleQueue()
        self._feedback: queue.SimpleQueue[tuple[Any] | None] = queue.SimpleQueue()
        self._ended: queue.SimpleQueue[tuple[int, Any] | Exception] = queue.SimpleQueue()

    def __iter__(self) -> Iterator[Any]:
        """Yields the feedback as it arrives, until the goal has ended."""
        while (feedback := self.next()) is not None:
            yield feedback

    def next(self, timeout: float | None = None) -> Any:
        """Returns the oldest feedback that has not been taken yet; None if the goal has ended.

        Args:
            timeout: How long to wait [s]; None for no limit.

        Raises:
            TimedOutError: No feedback arrived in time.
        """
        try:
            fed_back = self._feedback.get(timeout=None if timeout is None else bounded(timeout))
        except queue.Empty:
            raise TimedOutError(f"no feedback from {self.action} within {timeout:g} s") from None
        if fed_back is None:
            # For the next call.
            self._feedback.put(None)
            return None
        return fed_back[0]

    @property
    def done(self) -> bool:
        """Whether the goal has ended."""
        return self._finished

    def wait(self, timeout: float | None = None) -> str:
        """Waits until the goal has ended; returns how: `SUCCEEDED`, `CANCELED` or `ABORTED`.

        Args:
            timeout: How long to wait [s]; None for no limit.

        Raises:
            TimedOutError: The goal has not ended in time, or the server has stopped.
            RequestRefused: The server ended the goal with an error reply.
        """
        return STATUS.get(self._end(timeout)[0], "UNKNOWN")

    def result(self, timeout: float | None = None, check: bool = True) -> Any:
        """Waits until the goal has ended, and returns its result.

        Args:
            timeout: How long to wait [s]; None for no limit.
            check: Whether to raise an error if the goal was cancelled or aborted.

        Raises:
            GoalFailed: The goal was cancelled or aborted; the error contains the result.
            TimedOutError: The goal has not ended in time, or the server has stopped.
            RequestRefused: The server ended the goal with an error reply.
        """
        status, result = self._end(timeout)
        if check and status != _SUCCEEDED:
            fields = result if isinstance(result, dict) else dict(result)
            reason = next((fields[name] for name in _REASONS if isinstance(fields.get(name), str)), "")
            raise GoalFailed(self.action, STATUS.get(status, "UNKNOWN"), reason, result)
        return result

    def cancel(self) -> bool:
        """Asks the server to cancel the goal; returns whether it does. The goal ends some time later.

        Raises:
            TimedOutError: The server does not answer.
        """
        response = self._call_cancel(self)
        goals = response["goals_canceling"] if isinstance(response, dict) else response.goals_canceling
        return bool(goals)

    def send(self, session: zenoh.Session, request: Any, timeout: float) -> None:
        """Sends the goal and waits until it is accepted. The client calls this, once.

        Args:
            session: The session.
            request: The goal: a message, or nested dictionaries if there is no class.
            timeout: How long to wait [s].

        Raises:
            RequestRefused: The server rejects the goal.
            TimedOutError: There was no answer in time.
        """
        as_json = not isinstance(request, Message)
        session.get(
            f"{self._info.key}?goal_id={self.id}",
            Callback(self._receive, drop=self._drop, indirect=False),
            payload=to_json(request) if as_json else request.to_cdr(),
            encoding=zenoh.Encoding.APPLICATION_JSON if as_json else encoding_of("cdr", type(request)),
            consolidation=AT_ONCE,
            # The goal may take any time.
            timeout=bounded(float("inf")),
        )
        try:
            error = self._accepted.get(timeout=timeout)
        except queue.Empty:
            raise TimedOutError(f"no answer from {self.action} within {timeout:g} s") from None
        if error is not None:
            raise error

    def _end(self, timeout: float | None) -> tuple[int, Any]:
        try:
            ended = self._ended.get(timeout=None if timeout is None else bounded(timeout))
        except queue.Empty:
            raise TimedOutError(f"the goal of {self.action} has not ended within {timeout:g} s") from None
        self._ended.put(ended)
        if isinstance(ended, Exception):
            raise ended
        return ended

    def _receive(self, reply: zenoh.Reply) -> None:
        """Handles a reply. Never raises, because it runs on Zenoh's thread."""
        try:
            if reply.ok is None:
                assert reply.err is not None
                self._finish(RequestRefused(self.action, reply.err.payload.to_string()))
            else:
                self._read(str(reply.ok.encoding), reply.ok.payload.to_bytes())
        except (CodecError, ValueError, KeyError, TypeError) as error:
            self._finish(WrongTypeError(f"a reply of {self.action} cannot be decoded: {error}"))

    def _read(self, encoding: str, payload: bytes) -> None:
        if self._kind is None:
            content = json.loads(payload)
            if "feedback" in content:
                self._feed_back(content["feedback"])
            elif "result" in content:
                self._finish((content["status"], content["result"]))
            else:
                self._accepted.put(None)
        elif encoding.endswith(self._kind.FeedbackMessage.TYPE):
            message: Any = self._kind.FeedbackMessage.from_cdr(payload)
            self._feed_back(message.feedback)
        elif encoding.endswith(self._kind.GetResult.Response.TYPE):
            response: Any = self._kind.GetResult.Response.from_cdr(payload)
            self._finish((response.status, response.result))
        else:
            self._accepted.put(None)

    def _feed_back(self, feedback: Any) -> None:
        if self._callback is not None:
            try:
                self._callback(feedback)
            except Exception:
                _log.exception("the callback for feedback of %s failed", self.action)
            return
        while self._feedback.qsize() >= self._depth:
            self._feedback.get()
            self.dropped += 1
        self._feedback.put((feedback,))

    def _drop(self) -> None:
        """Handles the end of the query."""
        self._finish(
            TimedOutError(
                f"the goal of {self.action} ended without a result; its server {self._info.server} may have stopped, "
                "or does not permit this client to send goals"
            )
        )

    def _finish(self, ended: tuple[int, Any] | ClientError) -> None:
        if not self._finished:
            self._finished = True
            self._ended.put(ended)
            self._accepted.put(ended if isinstance(ended, Exception) else None)
            self._feedback.put(None)
