"""Declares `~/rollout`. The physics thread only copies the state; another thread simulates and sends the response."""

import logging
import os
import threading
from collections.abc import Callable, Generator
from queue import SimpleQueue
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from mjplug.errors import RequestError
from mjplug.log_scope import bound
from mjplug.physics import snapshot
from mjplug.physics.loop import Loop
from mjplug.physics.memory import float_view
from mjplug.physics.scheduler import Event, Wait
from mjplug.plugin import Call, Host, Slow
from mjplug.services.rollout.batch import Batch, Sequences, check_steps, widths
from mjplug.services.stepping.actions import checked_controls
from mjplug.services.stepping.arrays import check_count
from mjplug_schemas.mjplug_msgs import Rollout

MAX_WAITING = 8
"""Maximum number of requests that wait or are simulated at the same time."""

_log = logging.getLogger(__name__)

Find = Callable[[str, bool], Generator[Wait, None, NDArray[np.float64]]]
"""Returns the vector mjSTATE_INTEGRATION of a saved state, by its name and whether it is in a file."""


def offer(host: Host, loop: Loop, find: Find) -> Callable[[], None]:
    """Declares the service.

    Args:
        host: The host of the server.
        loop: The physics loop.
        find: Finds saved states.

    Returns:
        A function that ends the thread of the service.
    """
    rollouts = _Rollouts(loop, find)
    host.create_service(Rollout, "~/rollout", rollouts.serve, packed=True)
    return rollouts.close


class _Rollouts:
    """Handles the requests, and simulates them one after the other on a thread, which starts with the first request."""

    def __init__(self, loop: Loop, find: Find) -> None:
        self._loop = loop
        self._find = find
        self._queue: SimpleQueue[tuple[mujoco.MjModel, Callable[[Batch], None]] | None] = SimpleQueue()
        self._thread: threading.Thread | None = None
        self._waiting = 0
        self._closed = False

    def serve(self, request: Any, call: Call) -> Slow:
        """Handles one request."""
        model = self._loop.simulation.model
        controls = _controls(request, model.nu)
        check_steps(model, request.steps, controls.shape[1])
        observed = widths(model, request.observe)
        check_count(sum(observed) * controls.shape[0] * controls.shape[1], call.form)
        if request.name:
            start = yield from self._find(request.name, request.file)
        else:
            start = np.empty(snapshot.size(model))
            snapshot.take(model, self._loop.simulation.data, start)
        if self._waiting >= MAX_WAITING:
            raise RequestError(f"busy: {MAX_WAITING} rollouts are waiting, which is the maximum; try again later")
        # The state may have been read from a file meanwhile, and another model may be used.
        if self._loop.simulation.model is not model:
            raise RequestError("the model has changed; try again")
        sequences = Sequences(start, controls, request.steps, tuple(request.observe))
        ended, failures = Event(), list[str]()
        self._waiting += 1
        self._start(model, lambda batch: self._run(batch, sequences, observed, call, ended, failures))
        yield ended
        if failures:
            raise RequestError(failures[0])
        # The response has been sent by the other thread, because it may be large; this one is ignored.
        return Rollout.Response(success=True)

    def close(self) -> None:
        """Ends the thread after the sequences that it simulates now."""
        self._closed = True
        self._queue.put(None)

    def _start(self, model: mujoco.MjModel, task: Callable[[Batch], None]) -> None:
        if self._thread is None:
            # A daemon, so that the process can end during a long batch.
            self._thread = threading.Thread(target=bound(self._work), name="mjplug rollout", daemon=True)
            self._thread.start()
        self._queue.put((model, task))

    def _work(self) -> None:
        batch: Batch | None = None
        while (item := self._queue.get()) and not self._closed:
            model, task = item
            if batch is None or batch.model is not model:
                if batch is not None:
                    batch.close()
                batch = Batch(model, _processors())
            task(batch)
        if batch is not None:
            batch.close()

    def _run(
        self,
        batch: Batch,
        sequences: Sequences,
        observed: tuple[int, ...],
        call: Call,
        ended: Event,
        failures: list[str],
    ) -> None:
        """Simulates one request and sends the response, on the other thread."""
        try:
            result, diverged = batch.run(sequences, lambda: self._closed)
            values = result.reshape(-1)
            call.respond(
                Rollout.Response.unchecked(
                    success=True,
                    message=_message(sequences, diverged),
                    observations=tuple(values.tolist()) if call.form == "json" else float_view(values),
                    widths=observed,
                )
            )
        except Exception as error:
            _log.exception("a rollout failed")
            failures.append(f"internal error: {error!r}")

        def end() -> None:
            self._waiting -= 1
            ended.set()

        self._loop.inbox.post(end)


def _controls(request: Any, nu: int) -> NDArray[np.float64]:
    """Returns the controls of a request, shape (B, k, nu).

    Raises:
        RequestError: Their number is wrong, or a value is not finite.
    """
    batch = request.nbatch
    if not batch:
        raise RequestError("nbatch is 0; it must be at least 1")
    if not nu:
        raise RequestError("the model has no actuator, so all sequences would be equal")
    values = np.asarray(checked_controls(request.ctrl, nu, f"{batch} * k"))
    if not values.size or values.size % (batch * nu):
        raise RequestError(
            f"ctrl has {values.size} values; it must have {batch} * k * {nu} for {batch} sequences of k actions"
        )
    return values.reshape(batch, -1, nu)


def _message(sequences: Sequences, diverged: list[int]) -> str:
    batch, actions, _ = sequences.controls.shape
    text = f"simulated {batch} sequences of {actions} actions without plugins"
    if diverged:
        listed = ", ".join(map(str, diverged[:10])) + (", …" if len(diverged) > 10 else "")
        text += f"; {len(diverged)} of them diverged, and their rows are invalid: {listed}"
    return text


def _processors() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
