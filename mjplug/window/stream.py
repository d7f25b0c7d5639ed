"""The compiled model and the states of a server, from Zenoh; docs/wire.md describes the bytes."""

import gzip
import struct
from collections import deque
from typing import NamedTuple

import mujoco
import numpy as np
import zenoh
from numpy.typing import NDArray

from mjplug.client.errors import ClientError
from mjplug.client.view_query import query
from mjplug.wakeup import Wakeup
from mjplug.window.errors import WindowError

MODEL_TIMEOUT = 120.0
"""How long the server may take to send its model [s]; it saves a large model at the first query."""

SIGNATURE = int(mujoco.mjtState.mjSTATE_INTEGRATION)
"""The components of a state, for `mj_setState`."""

_HEADER = struct.Struct("<ddIIHHI")
_PAUSED = 1


class State(NamedTuple):
    """A state of the simulation.

    Attributes:
        time: Simulated time [s].
        epoch: Number of resets.
        step: Number of steps, lowest 32 bits.
        paused: Whether the simulation is paused.
        values: For `mj_setState` with `SIGNATURE`.
    """

    time: float
    epoch: int
    step: int
    paused: bool
    values: NDArray[np.float64]


def read_state(payload: bytes) -> State:
    """Returns the state in a payload of `@view/state`.

    Raises:
        WindowError: The payload is incomplete.
    """
    if len(payload) < _HEADER.size:
        raise WindowError(f"a state of the server has {len(payload)} bytes, which is less than its header")
    time, _, epoch, step, flags, _, count = _HEADER.unpack_from(payload)
    if len(payload) != _HEADER.size + 8 * count:
        raise WindowError(f"a state of the server has {len(payload)} bytes, but announces {count} values")
    values = np.frombuffer(payload, "<f8", offset=_HEADER.size).astype(np.float64, copy=False)
    return State(time, epoch, step, bool(flags & _PAUSED), values)


def fetch_model(session: zenoh.Session, key: str) -> mujoco.MjModel:
    """Returns the model of a server.

    Args:
        session: An open session.
        key: Zenoh key of the server, such as `robot1/mjplug`.

    Raises:
        WindowError: The server does not answer, or has another version of MuJoCo.
    """
    try:
        reply = query(session, f"{key}/@view/model", MODEL_TIMEOUT)
    except ClientError as error:
        raise WindowError(f"/{key} does not provide its model: {error}") from None
    version = "an unknown version" if reply.attachment is None else reply.attachment.to_string()
    if version != mujoco.__version__:
        raise WindowError(
            f"/{key} runs MuJoCo {version}, but this Python has MuJoCo {mujoco.__version__}, and MuJoCo's window "
            f"needs the same version: pip install mujoco=={version}; `mjplug view` without --window needs none"
        )
    content = gzip.decompress(reply.payload.to_bytes())
    return mujoco.MjModel.from_binary_path("model.mjb", {"model.mjb": content})


class States:
    """Subscribes to the states of a server, and keeps the newest.

    Args:
        session: An open session.
        key: Zenoh key of the server.
    """

    def __init__(self, session: zenoh.Session, key: str) -> None:
        # The newest payload that has not been returned.
        self._newest: deque[bytes] = deque(maxlen=1)
        self._arrived = Wakeup()
        self._subscriber = session.declare_subscriber(f"{key}/@view/state", self._receive)

    def next(self, timeout: float) -> State | None:
        """Waits for a state that is newer than the last returned one; returns None if there is none in time.

        Args:
            timeout: How long to wait [s].

        Raises:
            WindowError: The server sent something else.
        """
        self._arrived.wait_for(lambda: self._newest, timeout)
        return read_state(self._newest.pop()) if self._newest else None

    def close(self) -> None:
        """Unsubscribes."""
        # zenoh's stubs leave the return type open.
        self._subscriber.undeclare()  # type: ignore[no-untyped-call]

    def _receive(self, sample: zenoh.Sample) -> None:
        self._newest.append(sample.payload.to_bytes())
        self._arrived.notify()
