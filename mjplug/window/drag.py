"""Sends to the server what the user drags in a window; the server applies the spring."""

import json
import uuid
from time import monotonic
from typing import Any

import mujoco
import numpy as np
import zenoh

_REPEAT = 0.05
"""Interval at which an unchanged drag is repeated [s]; the server releases a body after 0.5 s without a message."""

_TRANSLATE, _ROTATE = int(mujoco.mjtPertBit.mjPERT_TRANSLATE), int(mujoco.mjtPertBit.mjPERT_ROTATE)


class Drag:
    """The drag of one window.

    Args:
        session: An open session.
        key: Zenoh key of the server.
    """

    def __init__(self, session: zenoh.Session, key: str) -> None:
        self._viewer = f"window-{uuid.uuid4().hex[:12]}"
        self._token = session.liveliness().declare_token(f"{key}/@view/viewer/{self._viewer}")
        self._publisher = session.declare_publisher(f"{key}/@view/drag")
        self._seq = 0
        self._last: dict[str, Any] | None = None
        self._sent = 0.0

    def update(self, model: mujoco.MjModel, perturbation: mujoco.MjvPerturb) -> None:
        """Sends a perturbation of MuJoCo's viewer; call it for every drawn frame.

        Args:
            model: The model.
            perturbation: What the user drags; inactive if nothing.
        """
        message = drag_message(model, perturbation)
        now = monotonic()
        if message == self._last and (message is None or now - self._sent < _REPEAT):
            return
        self._last, self._sent = message, now
        self._seq += 1
        fields = {"release": True} if message is None else message
        self._publisher.put(json.dumps({"viewer": self._viewer, "seq": self._seq, **fields}))

    def close(self) -> None:
        """Releases the body."""
        # zenoh's stubs leave the return types open.
        self._publisher.undeclare()  # type: ignore[no-untyped-call]
        self._token.undeclare()  # type: ignore[no-untyped-call]


def drag_message(model: mujoco.MjModel, perturbation: mujoco.MjvPerturb) -> dict[str, Any] | None:
    """Returns the fields of `@view/drag` for a perturbation; None if it is not active."""
    body, active = int(perturbation.select), int(perturbation.active) | int(perturbation.active2)
    if not active or body <= 0:
        return None
    message: dict[str, Any] = {"body": body, "local": perturbation.localpos.tolist()}
    if active & _TRANSLATE:
        message["target"] = perturbation.refselpos.tolist()
    if active & _ROTATE:
        # MuJoCo turns the inertial frame of the body.
        inverse, quat = np.empty(4), np.empty(4)
        mujoco.mju_negQuat(inverse, model.body_iquat[body])
        mujoco.mju_mulQuat(quat, perturbation.refquat, inverse)
        message["rotate"] = quat.tolist()
    return message
