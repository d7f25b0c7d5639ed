"""The bodies that viewers hold: one spring per viewer, which acts at every step until the viewer lets go."""

import logging
from time import perf_counter

import mujoco
import numpy as np

from mjplug.errors import RequestError
from mjplug.physics.body_spring import BodySpring, Grip
from mjplug.physics.loop import Loop
from mjplug.services.view.drag_message import DragMessage, parse
from mjplug.throttle import Throttle

HOLD_TIME = 0.5
"""A body is let go if its viewer has sent nothing for this wall time [s]."""

MAX_VIEWERS = 64
"""Maximum number of viewers that hold a body at the same time."""

_REPORT_INTERVAL = 10.0
_LOG = logging.getLogger(__name__)


class _Hold:
    """What one viewer holds.

    Attributes:
        spring: The spring; None after a reset, until the viewer lets go.
        grip: Body and point that are held.
        seq: Number of the last message; None if it had none.
        heard: When the last message was handled [s, by `perf_counter`].
    """

    def __init__(self, spring: BodySpring, grip: object, heard: float) -> None:
        self.spring: BodySpring | None = spring
        self.grip = grip
        self.seq: int | None = None
        self.heard = heard


class Drags:
    """Implements `mjplug.physics.steppers.Stepper`: it is active while a body with degrees of freedom is held.

    Args:
        loop: The physics loop.
    """

    def __init__(self, loop: Loop) -> None:
        self._loop = loop
        self._holds: dict[str, _Hold] = {}
        self._springs: tuple[BodySpring, ...] = ()
        # The newest message of each viewer; Zenoh's threads add, the physics thread takes.
        self._arrived: dict[str, DragMessage] = {}
        # Viewers that have disconnected, after their messages.
        self._gone: set[str] = set()
        self._posted = False
        self._refusals = Throttle(_REPORT_INTERVAL)
        self._timer = loop.wall_timers.create(self._check)
        loop.steppers.add(self)
        # Bodies have other ids, so viewers must take them again.
        loop.on_model_changed.append(lambda change: self.on_reset())

    @property
    def grips(self) -> tuple[Grip, ...]:
        """What is dragged, and where to. Physics thread."""
        return tuple(hold.spring.grip for hold in self._holds.values() if hold.spring is not None)

    def receive(self, payload: bytes) -> None:
        """Takes a message; the next boundary between steps handles it. Any thread."""
        try:
            message = parse(payload)
        except RequestError as error:
            self._refused(str(error))
            return
        if len(self._arrived) < MAX_VIEWERS or message.viewer in self._arrived:
            self._arrived[message.viewer] = message
            self._post()

    def left(self, viewer: str) -> None:
        """Lets go for a viewer that has disconnected. Any thread."""
        # Any client may declare tokens; those of viewers that hold nothing do not matter.
        if viewer in self._holds or viewer in self._arrived:
            self._gone.add(viewer)
            self._post()

    def update(self) -> None:
        """Adds the forces of all springs."""
        for spring in self._springs:
            spring.apply()

    def on_reset(self) -> None:
        """Lets all bodies go; a viewer must release before it can hold one again."""
        for hold in self._holds.values():
            hold.spring = None
        self._changed()

    def failed(self, error: BaseException) -> None:
        """Lets all bodies go after an error."""
        _LOG.error("dragging bodies failed", exc_info=error)
        self._holds.clear()
        self._springs = ()

    def _post(self) -> None:
        """Lets the physics thread handle what has arrived, with one call for any number of messages. Any thread."""
        if not self._posted:
            self._posted = True
            self._loop.inbox.post(self._handle_arrived)

    def _handle_arrived(self) -> None:
        # Before the messages are taken, so that one that arrives meanwhile is posted again.
        self._posted = False
        for viewer in tuple(self._arrived):
            message = self._arrived.pop(viewer)
            if message.release:
                self._release(viewer)
                continue
            try:
                self._hold(message)
            except RequestError as error:
                self._refused(str(error))
        for viewer in tuple(self._gone):
            self._gone.discard(viewer)
            self._release(viewer)

    def _hold(self, message: DragMessage) -> None:
        hold = self._holds.get(message.viewer)
        if hold is not None and message.seq is not None and hold.seq is not None and message.seq <= hold.seq:
            return
        now, grip = perf_counter(), (message.body, message.local)
        if hold is None or (hold.spring is not None and hold.grip != grip):
            if hold is None and len(self._holds) >= MAX_VIEWERS:
                raise RequestError(f"{MAX_VIEWERS} viewers hold bodies, which is the maximum")
            spring = BodySpring(self._loop.simulation, self._body(message), message.local)
            hold = self._holds[message.viewer] = _Hold(spring, grip, now)
            self._changed()
        hold.seq, hold.heard = message.seq, now
        self._timer.set(min(self._timer.due, now + HOLD_TIME))
        if hold.spring is None:
            return
        hold.spring.set(message.target, _unit(message.rotate))
        if self._loop.paused or not hold.spring.dynamic:
            hold.spring.place()
            if self._loop.paused:
                self._loop.simulation.forward()

    def _body(self, message: DragMessage) -> int:
        simulation = self._loop.simulation
        if isinstance(message.body, str):
            return simulation.body_id(message.body)
        body, count = message.body, int(simulation.model.nbody)
        if body is None or not 0 <= body < count:
            raise RequestError(f"body is {body}; the model has {count} bodies, numbered from 0")
        return body

    def _release(self, viewer: str) -> None:
        if self._holds.pop(viewer, None) is not None:
            self._changed()

    def _check(self, now: float) -> None:
        """Lets go what viewers hold that have sent nothing for too long."""
        for viewer in [viewer for viewer, hold in self._holds.items() if now - hold.heard >= HOLD_TIME]:
            self._release(viewer)
        if self._holds:
            self._timer.set(min(hold.heard for hold in self._holds.values()) + HOLD_TIME)

    def _changed(self) -> None:
        springs = (hold.spring for hold in self._holds.values())
        self._springs = tuple(spring for spring in springs if spring is not None and spring.dynamic)
        if self._springs:
            self._loop.steppers.activate(self)
        else:
            self._loop.steppers.deactivate(self)

    def _refused(self, reason: str) -> None:
        if self._refusals.admit(perf_counter()):
            _LOG.warning("a message to @view/drag was refused: %s%s", reason, self._refusals.suppressed())


def _unit(quat: tuple[float, ...] | None) -> tuple[float, ...] | None:
    if quat is None:
        return None
    # Scaling first prevents overflow and underflow in the norm.
    values = np.array(quat) / max(map(abs, quat))
    mujoco.mju_normalize4(values)
    return tuple(values)
