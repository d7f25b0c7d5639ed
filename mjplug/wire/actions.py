"""Goals that a client sends with one query on the action's own name. Runs on Zenoh's threads, except `GoalQuery`.

The first reply says that the goal is accepted, further ones contain feedback, and the last one contains the result. All
have the key of the query, so a client with Zenoh's default consolidation gets the last reply only.
"""

import logging
import threading
from collections.abc import Callable, Mapping
from typing import Any
from uuid import UUID

from mjplug.contracts import actions
from mjplug.contracts.actions import ActionName
from mjplug.wire.calls import OpenCalls
from mjplug.wire.dialect import RawGoal
from mjplug.wire.encoding import DEFAULT_LIMITS, Decoder, Form, Limits, PayloadError, encoding_of
from mjplug.wire.rejections import Rejections
from mjplug_schemas.action import Action
from mjplug_schemas.message import Message

_LOG = logging.getLogger(__name__)

MAX_QUEUED_FEEDBACK = 100
"""Maximum number of feedback replies of one goal that wait to be sent; further feedback is dropped."""


class GoalQuery:
    """A decoded goal. Implements `mjplug.contracts.actions.GoalQuery`, and can be an open call of a session.

    Attributes:
        request: The goal.
        size: Size of the data that Zenoh keeps until the last reply [bytes].
        form: The form of the goal and of the replies.
        service: The service that would send the same goal.
        dropped: Number of feedback replies that were dropped.

    Args:
        raw: The encoded goal.
        request: The goal.
        form: As above.
        action: The action's class.
        open_calls: The open calls of the session.
    """

    def __init__(self, raw: RawGoal, request: Message, form: Form, action: type[Action], open_calls: OpenCalls) -> None:
        self.request = request
        self.size = raw.size
        self.parameters: Mapping[str, str] = raw.parameters
        self.form = form
        self.service = action.SendGoal
        self.dropped = 0
        self._open_calls = open_calls
        # The thread that sends the last reply takes the request out; list.pop succeeds in one thread only.
        self._raw = [raw]
        self._queued = threading.Semaphore(MAX_QUEUED_FEEDBACK)

    def accept(self, response: Message, goal_id: bytes) -> None:
        """Sends the first reply."""
        self._send(lambda: self._payload(response, goal_id), response)

    def feedback(self, message: Any) -> None:
        """Sends feedback, unless the client is too slow."""
        if not self._queued.acquire(blocking=False):
            self.dropped += 1
            return

        def encode() -> bytes:
            self._queued.release()
            if self.form == "cdr":
                return bytes(message.to_cdr())
            return _json(feedback=message.feedback, goal_id=bytes(message.goal_id.uuid))

        self._send(encode, message)

    def respond(self, response: Message, goal_id: bytes) -> None:
        """Sends the last reply."""
        if raw := self._take():
            payload = self._payload(response, goal_id)
            encoding = encoding_of(self.form, type(response))

            def send() -> None:
                raw.reply_part(payload, encoding)
                raw.end()

            self._open_calls.replies.post(send)

    def refuse(self, reason: str) -> None:
        """Sends an error reply as the last reply."""
        if raw := self._take():
            self._open_calls.refuse(raw, self.service, reason, self.form)

    def _send(self, encode: Callable[[], bytes], message: Message) -> None:
        raw = next(iter(self._raw), None)
        if raw is not None:
            # Encoded on the thread that sends, because a handler may send feedback at every step.
            encoding = encoding_of(self.form, type(message))
            self._open_calls.replies.post(lambda: raw.reply_part(encode(), encoding))

    def _payload(self, response: Any, goal_id: bytes) -> bytes:
        if self.form == "cdr":
            return bytes(response.to_cdr())
        return _json(response, goal_id=goal_id)

    def _take(self) -> RawGoal | None:
        try:
            raw = self._raw.pop()
        except IndexError:
            return None
        self._open_calls.discard(self)
        return raw


class GoalReceiver:
    """Decodes the goals of one action that are sent with one query each.

    Attributes:
        rejections: Counts invalid goals.

    Args:
        action: The action.
        deliver: Called with each goal; it may only enqueue.
        open_calls: The session's open calls.
        limits: Size limits of goals.
    """

    def __init__(
        self,
        action: ActionName,
        deliver: Callable[[actions.GoalQuery], None],
        open_calls: OpenCalls,
        limits: Limits = DEFAULT_LIMITS,
    ) -> None:
        self.rejections = Rejections(f"action {action.name}: a goal was refused")
        self._action = action
        self._deliver = deliver
        self._open_calls = open_calls
        self._decoder = Decoder(action.type.Goal, limits, action.type.TYPE, empty=True)

    def receive(self, raw: RawGoal) -> None:
        """Handles one goal. Never raises, because it runs on Zenoh's thread."""
        try:
            form, request = self._decoder.decode(raw.received)
        except PayloadError as error:
            self.rejections.add(str(error))
            reason = str(error)
            self._open_calls.replies.post(lambda: raw.reply_error(reason))
            return
        query = GoalQuery(raw, request, form, self._action.type, self._open_calls)
        if self._open_calls.admit(query) != "admitted":
            return
        try:
            self._deliver(query)
        except Exception:
            _LOG.exception("action %s: delivering a goal failed", self._action.name)
            query.refuse("internal error: delivering the goal failed; see the server's log")


def _json(message: Message | None = None, *, feedback: Message | None = None, goal_id: bytes) -> bytes:
    """Returns the JSON of a reply: the fields of the message, or the feedback, and the identifier of the goal."""
    identifier = b'"goal_id":"%s"' % str(UUID(bytes=goal_id)).encode()
    if feedback is not None:
        return b'{"feedback":%s,%s}' % (feedback.to_json(), identifier)
    assert message is not None
    return b"%s,%s}" % (message.to_json().removesuffix(b"}"), identifier)
