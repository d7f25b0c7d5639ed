"""Steps a server and reads results as numpy arrays; the same functions over Zenoh and inside the server's process.

This is the only module of the client that needs numpy.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from itertools import accumulate
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mjplug.client.errors import ClientError, WrongTypeError
from mjplug.client.types import as_message, find
from mjplug_schemas.message import Message, Service
from mjplug_schemas.mjplug_msgs import Rollout, Sample, Step

Array = NDArray[np.float64]

DEFAULT_OBSERVE = ("qpos", "qvel")
"""The arrays that are returned by default."""

_MAX_UINT32 = 2**32 - 1

_ROWS: Mapping[str, int] = {
    **dict.fromkeys(("xpos", "xipos", "xanchor", "xaxis", "geom_xpos", "site_xpos", "cam_xpos"), 3),
    **dict.fromkeys(("subtree_com", "subtree_linvel", "subtree_angmom", "mocap_pos"), 3),
    **dict.fromkeys(("xquat", "mocap_quat"), 4),
    **dict.fromkeys(("xfrc_applied", "cvel", "cfrc_ext"), 6),
    **dict.fromkeys(("xmat", "ximat", "geom_xmat", "site_xmat", "cam_xmat"), 9),
}
"""Length of the rows of two-dimensional arrays of mjData; the others have one dimension."""


class Arrays(Mapping[str, Array]):
    """Arrays of mjData by name, as writable views of one block of numbers.

    The last dimensions of an array are those in MuJoCo; before them is one dimension for the actions, and in a result
    of `simulate` one for the sequences.

    Args:
        names: Names of the arrays.
        widths: Number of values of each array.
        values: All values, shape (..., sum(widths)).
    """

    def __init__(self, names: Sequence[str], widths: Sequence[int], values: Array) -> None:
        self._values = values
        self._places = _places(tuple(names), tuple(widths))

    def __getitem__(self, name: str) -> Array:
        begin, end = self._places[name]
        values = self._values[..., begin:end]
        if name in _ROWS:
            return values.reshape(*values.shape[:-1], -1, _ROWS[name])
        return values

    def __iter__(self) -> Iterator[str]:
        return iter(self._places)

    def __len__(self) -> int:
        return len(self._places)


class StepResult(Arrays):
    """The results of steps: the observed arrays by name, such as `result["qpos"]`, and samples of topics.

    Attributes:
        step: Number of steps taken since the start.
        time_ns: Simulated time since the start [ns].
        epoch: Number of resets and restores.
        samples: The encoded messages of the topics in `outputs`, one for each publisher.

    Args:
        response: The response of `~/step`.
        names: The names in `observe`.
        actions: Number of actions; None means one, without a dimension for it.
    """

    def __init__(self, response: Any, names: Sequence[str], actions: int | None) -> None:
        widths = tuple(response.widths)
        width = sum(widths)
        rows = numbers(response.observations).reshape(-1 if width else actions or 1, width)
        # Several actions may also be given as one flat array.
        super().__init__(names, widths, rows[0] if actions is None and len(rows) == 1 else rows)
        self.step: int = response.step
        self.time_ns: int = response.stamp.sec * 1_000_000_000 + response.stamp.nanosec
        self.epoch: int = response.epoch
        self.samples: tuple[Sample, ...] = tuple(response.outputs)

    def message(self, topic: str) -> Any:
        """Returns the message of a topic in `outputs`; None if none was published during the steps.

        Args:
            topic: Full name of the topic. If it has several publishers, the message of the first one that has one.
        """
        return next(iter(self.messages(topic)), None)

    def messages(self, topic: str) -> list[Any]:
        """Returns the messages of a topic in `outputs`, one for each publisher that has one."""
        samples = [sample for sample in self.samples if sample.topic == topic]
        if not samples:
            raise ClientError(
                f"{topic} is not in outputs; topics: {', '.join(s.topic for s in self.samples) or 'none'}"
            )
        return [find(sample.type).from_cdr(sample.cdr) for sample in samples if sample.cdr]


class Driver(ABC):
    """Steps a paused server. Not thread-safe."""

    def step(
        self,
        n: int = 1,
        ctrl: ArrayLike | None = None,
        inputs: Mapping[str, Any] | None = None,
        observe: Sequence[str] = DEFAULT_OBSERVE,
        outputs: Sequence[str] = (),
        timeout: float | None = None,
    ) -> StepResult:
        """Takes steps; see `Client.step`."""
        rows = None if ctrl is None else np.asarray(ctrl, np.float64)
        if rows is not None and rows.ndim not in (1, 2):
            raise WrongTypeError(f"ctrl has the shape {rows.shape}; it must be (nu,) or (k, nu)")
        actions = len(rows) if rows is not None and rows.ndim == 2 else None
        if rows is not None and actions is not None and not rows.size:
            raise WrongTypeError(f"ctrl has the shape {rows.shape}; it must contain at least one value")
        # Not validated, because the server checks it.
        request = Step.Request.unchecked(
            steps=_count(n),
            ctrl=() if rows is None else packed(rows),
            inputs=() if not inputs else self._samples(inputs),
            observe=tuple(observe),
            outputs=tuple(outputs),
        )
        response = self._exchange("~/step", Step, request, 1e-3 * n * (actions or 1), timeout)
        return StepResult(response, request.observe, actions)

    def rollout(
        self,
        actions: ArrayLike,
        n: int = 1,
        inputs: Mapping[str, Any] | None = None,
        observe: Sequence[str] = DEFAULT_OBSERVE,
        outputs: Sequence[str] = (),
        timeout: float | None = None,
    ) -> StepResult:
        """Takes steps with one row of controls after the other; see `Client.rollout`."""
        rows = np.asarray(actions, np.float64)
        if rows.ndim != 2:
            raise WrongTypeError(f"actions have the shape {rows.shape}; it must be (k, nu)")
        return self.step(n, rows, inputs, observe, outputs, timeout)

    def simulate(
        self,
        actions: ArrayLike,
        n: int = 1,
        state: str = "",
        observe: Sequence[str] = DEFAULT_OBSERVE,
        file: bool = False,
        timeout: float | None = None,
    ) -> Arrays:
        """Simulates sequences of actions in copies; see `Client.simulate`."""
        rows = np.asarray(actions, np.float64)
        if rows.ndim != 3 or 0 in rows.shape[:2]:
            raise WrongTypeError(f"actions have the shape {rows.shape}; it must be (B, k, nu), with B and k at least 1")
        batch, count = rows.shape[:2]
        request = Rollout.Request.unchecked(
            name=state, file=file, nbatch=batch, steps=_count(n), ctrl=packed(rows), observe=tuple(observe)
        )
        response = self._exchange("~/rollout", Rollout, request, 1e-3 * n * batch * count, timeout)
        widths = tuple(response.widths)
        return Arrays(request.observe, widths, numbers(response.observations).reshape(batch, count, sum(widths)))

    @abstractmethod
    def _exchange(
        self, name: str, service: type[Service], request: Message, duration: float, timeout: float | None
    ) -> Any:
        """Sends a request and returns the response.

        Args:
            name: Name of the service.
            service: Its class.
            request: The request.
            duration: How long the request is expected to take [s].
            timeout: How long to wait [s]; None for the expected duration and a margin.

        Raises:
            RequestRefused: The request was refused.
        """

    @abstractmethod
    def _message_class(self, topic: str) -> tuple[str, type[Message]]:
        """Returns the full name and the message class of a topic that the server reads."""

    def _samples(self, inputs: Mapping[str, Any]) -> tuple[Sample, ...]:
        samples = []
        for name, given in inputs.items():
            for one in given if isinstance(given, list | tuple) else (given,):
                topic, kind = self._message_class(name)
                message = as_message(one, kind)
                samples.append(Sample(topic=topic, type=kind.TYPE, cdr=message.to_cdr()))
        return tuple(samples)


def packed(values: Array) -> Any:
    """Returns a copy of numbers as a flat memoryview of float64, which is encoded in one piece."""
    return memoryview(values.tobytes()).cast("d")


def numbers(values: Any) -> Array:
    """Returns numbers of a response as an aligned, writable array."""
    array = np.asarray(values, np.float64)
    return array if array.flags.behaved else array.copy()


@lru_cache
def _places(names: tuple[str, ...], widths: tuple[int, ...]) -> dict[str, tuple[int, int]]:
    """Returns where the values of each array begin and end."""
    ends = list(accumulate(widths))
    return {name: (end - width, end) for name, width, end in zip(names, widths, ends, strict=True)}


def _count(n: Any) -> int:
    if isinstance(n, bool) or not isinstance(n, int | np.integer) or not 0 <= n <= _MAX_UINT32:
        raise WrongTypeError(f"n is {n!r}; it must be an integer from 0 to {_MAX_UINT32}")
    return int(n)
