"""Actions: accepts goals, runs their handlers, and reports states, feedback and results. Physics thread only."""

from __future__ import annotations

import logging
import uuid
from collections.abc import Callable, Generator
from time import perf_counter
from typing import Any

from mjplug.contracts.actions import ActionCallbacks, ActionName, ActionPublishers, ActionTransport, GoalQuery
from mjplug.contracts.transport import Call
from mjplug.errors import RequestError
from mjplug.physics.loop import Loop
from mjplug.physics.scheduler import Wait, WaitingCall
from mjplug.plugin.goal import Goal, GoalCanceled, Outcome, failure
from mjplug.plugin.prepared import Prepare, Prepared
from mjplug.throttle import Throttle
from mjplug_schemas.action_msgs import CancelGoal, GoalStatus, GoalStatusArray
from mjplug_schemas.builtin_interfaces import Time
from mjplug_schemas.message import Message
from mjplug_schemas.unique_identifier_msgs import UUID

GoalRun = Generator[Wait, None, Message | Outcome]
"""A handler that takes simulated time. It yields waits, and returns the result or an outcome."""

GoalHandler = Callable[[Any, Goal], "Message | Outcome | GoalRun"]
"""Handles one goal; see `NodeView.create_action`."""

MAX_GOALS = 64
"""Maximum number of goals of one action that are under way; further goals are rejected."""

RESULT_TIMEOUT = 10.0
"""Time for which the result of an ended goal is kept [s of wall time]; rcl's default."""

MAX_RESULTS = 200
"""Maximum number of results of one action that are kept."""

MAX_LISTED = 16
"""Maximum number of ended goals in a status message, which is encoded at each change, on the physics thread."""

REJECTION_LOG_INTERVAL = 1.0
"""Minimum wall time between two log lines about rejected goals of one action [s]."""

ALL_GOALS = bytes(16)
"""The identifier in a request to cancel several goals; no goal can have it."""


class _Entry:
    """A goal that the server knows, and who waits for its result."""

    def __init__(self, goal: Goal, query: GoalQuery | None) -> None:
        self.goal = goal
        self.query = query
        self.waiting: list[Call] = []
        self.run: WaitingCall | None = None
        self.response: Any = None
        self.ended_at = 0.0
        self.message = GoalStatus()

    def update(self) -> None:
        """Makes the entry of the status message."""
        self.message = GoalStatus(goal_info=self.goal.info, status=self.goal.status)


class _Answer:
    """Receives the outcome of a handler. Implements `mjplug.physics.scheduler.Answer`."""

    def __init__(self) -> None:
        self.outcome: Outcome | None = None
        self.refusal: str | None = None
        self.ended: Callable[[], None] | None = None

    def respond(self, response: Any) -> None:
        self.outcome = response
        self._end()

    def refuse(self, reason: str) -> None:
        self.refusal = reason
        self._end()

    def _end(self) -> None:
        if self.ended is not None:
            self.ended()


class ActionServer:
    """One action.

    Args:
        loop: The physics loop.
        transport: Declares the action.
        action: The action's name and type.
        handler: Handles a goal; see `NodeView.create_action`.
        now: Returns the simulated time.
        logger: Logs rejected goals.
        owner: Owner of the goals, for `Scheduler.cancel`.
        closed: Returns why no goals are accepted; empty if they are.
        on_abort: Makes the result of a goal that the server ends, from the reason; None puts the reason into the text
            field of the result, if it has one.
        prepare: Called with each request on the transport's thread; `handler` gets what it returns.
    """

    def __init__(
        self,
        loop: Loop,
        transport: ActionTransport,
        action: ActionName,
        handler: GoalHandler,
        now: Callable[[], Time],
        logger: logging.Logger,
        owner: object = None,
        closed: Callable[[], str] = lambda: "",
        on_abort: Callable[[str], Message] | None = None,
        prepare: Prepare | None = None,
    ) -> None:
        self._loop = loop
        self._action = action
        # Any: the fields of derived types are not known to mypy.
        self._type: Any = action.type
        self._handler = handler
        self._now = now
        self._logger = logger
        self._owner = owner
        self._closed = closed
        self._on_abort = on_abort
        self._prepare: Prepare = prepare or _unchanged
        self._released = ""
        self._entries: dict[bytes, _Entry] = {}
        self._rejections = Throttle(REJECTION_LOG_INTERVAL)
        self._publishers: ActionPublishers = transport.open_action(
            action,
            ActionCallbacks(
                self._goal_arrived,
                lambda call: loop.inbox.post(lambda: self._cancel_goal(call)),
                lambda call: loop.inbox.post(lambda: self._get_result(call)),
                self._query_arrived,
            ),
        )
        loop.on_second.append(self._expire)

    def use(
        self, handler: GoalHandler, on_abort: Callable[[str], Message] | None = None, prepare: Prepare | None = None
    ) -> None:
        """Handles goals with other functions from now on; see `NodeView.create_action`."""
        self._handler, self._on_abort, self._prepare = handler, on_abort, prepare or _unchanged
        self._released = ""

    def release(self) -> None:
        """Rejects goals until `use` is called."""
        self._released = "the object that this belongs to is no longer in the model"

    @property
    def under_way(self) -> list[Goal]:
        """The goals that have not ended, in the order in which they were accepted."""
        return [entry.goal for entry in self._entries.values() if not entry.goal.ended]

    def _goal_arrived(self, call: Call) -> None:
        """Handles a request on the transport's thread."""
        sent: Any = call.request
        prepared = Prepared(self._prepare, sent.goal)
        self._loop.inbox.post(lambda: self._send_goal(call, prepared))

    def _query_arrived(self, query: GoalQuery) -> None:
        """Handles a query on the transport's thread."""
        prepared = Prepared(self._prepare, query.request)
        self._loop.inbox.post(lambda: self._query(query, prepared))

    def _send_goal(self, call: Call, prepared: Prepared) -> None:
        request: Any = call.request
        try:
            entry = self._start(bytes(request.goal_id.uuid), request.goal, prepared, None)
        except RequestError as error:
            self._log_rejection(str(error))
            call.respond(self._type.SendGoal.Response())
            return
        call.respond(self._type.SendGoal.Response(accepted=True, stamp=entry.goal.stamp))
        self._begin(entry)

    def _query(self, query: GoalQuery, prepared: Prepared) -> None:
        try:
            goal_id = _id_in(query) or uuid.uuid4().bytes
            entry = self._start(goal_id, query.request, prepared, query)
        except RequestError as error:
            query.refuse(str(error))
            return
        query.accept(self._type.SendGoal.Response(accepted=True, stamp=entry.goal.stamp), goal_id)
        self._begin(entry)

    def _start(self, goal_id: bytes, request: Message, prepared: Prepared, query: GoalQuery | None) -> _Entry:
        """Runs the handler of a new goal to its first wait.

        Raises:
            RequestError: The goal is rejected.
        """
        if closed := self._closed() or self._released:
            raise RequestError(closed)
        if goal_id == ALL_GOALS:
            raise RequestError("the identifier of the goal is zero; choose a random one")
        if goal_id in self._entries:
            raise RequestError(f"goal {uuid.UUID(bytes=goal_id)} was sent before; choose a new identifier")
        if (count := len(self.under_way)) >= MAX_GOALS:
            raise RequestError(f"busy: {count} goals are under way, which is the maximum; try again later")
        goal = Goal(self._type, goal_id, request, self._now(), self._feedback, self._observed)
        entry, answer = _Entry(goal, query), _Answer()
        # Known from now on, so that the handler itself may end other goals.
        self._entries[goal_id] = entry
        entry.run = self._loop.scheduler.start(self._run(goal, prepared), answer, self._owner)
        if answer.refusal is not None:
            del self._entries[goal_id]
            raise RequestError(answer.refusal)
        # Only now can clients and the scheduler end the goal.
        answer.ended = lambda: self._end(entry, answer)
        entry.response = None if answer.outcome is None else self._response(answer.outcome)
        return entry

    def _begin(self, entry: _Entry) -> None:
        """Reports that a goal was accepted, after the client was told so."""
        entry.goal.accept()
        if entry.response is None:
            self._changed(entry)
        else:
            self._finish(entry, entry.response)

    def _run(self, goal: Goal, prepared: Prepared) -> Generator[Wait, None, Outcome]:
        try:
            returned: Any = self._handler(prepared.get(self._prepare), goal)
            if isinstance(returned, Generator):
                returned = yield from returned
            return goal.outcome(returned)
        except GoalCanceled:
            return goal.canceled()
        except RequestError as error:
            if not goal.accepted:
                raise
            return goal.aborted(self._failure(str(error)))

    def _end(self, entry: _Entry, answer: _Answer) -> None:
        outcome = answer.outcome or entry.goal.aborted(self._failure(answer.refusal or ""))
        self._finish(entry, self._response(outcome))

    def _response(self, outcome: Outcome) -> Any:
        return self._type.GetResult.Response(status=outcome.status, result=outcome.result)

    def _finish(self, entry: _Entry, response: Any) -> None:
        goal = entry.goal
        if goal.ended:
            return
        goal.status = response.status
        entry.response, entry.ended_at, entry.run = response, perf_counter(), None
        waiting, entry.waiting = entry.waiting, []
        query, entry.query = entry.query, None
        ended = sorted((e for e in self._entries.values() if e.goal.ended), key=lambda e: e.ended_at)
        for old in ended[: max(0, len(ended) - MAX_RESULTS)]:
            del self._entries[old.goal.id]
        self._changed(entry)
        for call in waiting:
            call.respond(response)
        if query is not None:
            query.respond(response, goal.id)

    def _failure(self, reason: str) -> Message:
        return failure(self._type, reason) if self._on_abort is None else self._on_abort(reason)

    def _observed(self, goal: Goal) -> bool:
        return self._entries[goal.id].query is not None or self._publishers.feedback.matched

    def _feedback(self, goal: Goal, feedback: Message) -> None:
        entry, publisher = self._entries[goal.id], self._publishers.feedback
        if not self._observed(goal):
            return
        message = self._type.FeedbackMessage(goal_id=UUID(uuid=goal.id), feedback=feedback)
        if publisher.matched:
            publisher.publish(message)
        if entry.query is not None:
            entry.query.feedback(message)

    def _get_result(self, call: Call) -> None:
        request: Any = call.request
        try:
            goal_id = _id_in(call) or bytes(request.goal_id.uuid)
        except RequestError as error:
            call.refuse(str(error))
            return
        entry = self._entries.get(goal_id)
        if entry is None:
            # As in rcl: the state is "unknown".
            call.respond(self._type.GetResult.Response())
        elif entry.goal.ended and entry.response is not None:
            call.respond(entry.response)
        else:
            entry.waiting.append(call)

    def _cancel_goal(self, call: Call) -> None:
        request: Any = call.request
        try:
            goal_id = _id_in(call) or bytes(request.goal_info.goal_id.uuid)
        except RequestError as error:
            call.refuse(str(error))
            return
        stamp = request.goal_info.stamp.to_ns()
        entry = self._entries.get(goal_id)
        code = CancelGoal.Response.ERROR_NONE
        if goal_id != ALL_GOALS and not stamp:
            if entry is None:
                code = CancelGoal.Response.ERROR_UNKNOWN_GOAL_ID
            elif entry.goal.ended:
                code = CancelGoal.Response.ERROR_GOAL_TERMINATED
        every = goal_id == ALL_GOALS and not stamp
        chosen = [
            other
            for other in self._entries.values()
            if not other.goal.ended and (every or other is entry or (stamp and other.goal.stamp.to_ns() <= stamp))
        ]
        infos = tuple(other.goal.info for other in chosen)
        call.respond(CancelGoal.Response(return_code=code, goals_canceling=infos))
        for other in chosen:
            self._cancel(other)

    def _cancel(self, entry: _Entry) -> None:
        if entry.goal.status != GoalStatus.STATUS_EXECUTING:
            return
        entry.goal.status = GoalStatus.STATUS_CANCELING
        self._changed(entry)
        if entry.run is not None:
            self._loop.scheduler.interrupt(entry.run, GoalCanceled("a client cancelled the goal"))

    def _changed(self, entry: _Entry) -> None:
        """Publishes the states of the goals that are under way, and of the last ones that have ended."""
        entry.update()
        accepted = [other for other in self._entries.values() if other.goal.accepted]
        ended = sorted((other for other in accepted if other.goal.ended), key=lambda other: other.ended_at)
        unlisted = set(ended[:-MAX_LISTED])
        listed = tuple(other.message for other in accepted if other not in unlisted)
        self._publishers.status.publish(GoalStatusArray(status_list=listed))

    def _expire(self, now: float) -> None:
        """Forgets old results."""
        expired = [e for e in self._entries.values() if e.goal.ended and now - e.ended_at >= RESULT_TIMEOUT]
        for entry in expired:
            del self._entries[entry.goal.id]

    def _log_rejection(self, reason: str) -> None:
        if self._rejections.admit(perf_counter()):
            self._logger.warning(
                "action %s: a goal was rejected: %s%s", self._action.name, reason, self._rejections.suppressed()
            )


def _unchanged(request: Any) -> Any:
    return request


def _id_in(call: Call | GoalQuery) -> bytes:
    """Returns the identifier in the selector of a client; empty if there is none.

    Raises:
        RequestError: It is not a UUID.
    """
    text = call.parameters.get("goal_id")
    if text is None:
        return b""
    try:
        return uuid.UUID(text).bytes
    except ValueError:
        raise RequestError(f"goal_id is {text[:60]!r}; it must be a UUID: 32 hexadecimal digits") from None
