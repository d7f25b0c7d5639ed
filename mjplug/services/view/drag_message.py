"""The JSON message of `@view/drag`."""

from typing import Annotated, Self

import mujoco
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from mjplug.errors import RequestError, quoted

MAX_BYTES = 4096
"""Maximum size of a message [bytes]."""

_MIN_NORM = 1e-9
_Coordinate = Annotated[float, Field(gt=-mujoco.mjMAXVAL, lt=mujoco.mjMAXVAL)]
_Vector = Annotated[tuple[_Coordinate, _Coordinate, _Coordinate], Field(strict=False)]
_Quaternion = Annotated[tuple[_Coordinate, _Coordinate, _Coordinate, _Coordinate], Field(strict=False)]


class DragMessage(BaseModel):
    """What a viewer holds, or that it lets go.

    Attributes:
        viewer: Name of the viewer, which it chooses; letters, digits, `_`, `.` and `-`.
        seq: Number of the message; one that is not above the last one is ignored. None is never ignored.
        release: Whether the viewer lets go; then only `viewer` counts.
        body: Name or id of the body.
        local: The point that is held, in the body's frame [m].
        target: Where the point is pulled to, in the world frame [m].
        rotate: Orientation that the body is turned to, quaternion with w first; it need not have unit length.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    viewer: str = Field(pattern=r"^[A-Za-z0-9_.-]{1,64}$")
    seq: int | None = None
    release: bool = False
    body: str | int | None = None
    local: _Vector = (0.0, 0.0, 0.0)
    target: _Vector | None = None
    rotate: _Quaternion | None = None

    @model_validator(mode="after")
    def _complete(self) -> Self:
        if self.release:
            return self
        if self.body is None:
            raise ValueError("body is missing; give its name or id, or release: true")
        if self.target is None and self.rotate is None:
            raise ValueError("target and rotate are missing; give at least one of them")
        if self.rotate is not None and max(map(abs, self.rotate)) < _MIN_NORM:
            raise ValueError(f"rotate is {self.rotate}; its norm must not be zero")
        return self


def parse(payload: bytes) -> DragMessage:
    """Returns the message.

    Raises:
        RequestError: The payload is not a valid message; the text names every problem.
    """
    try:
        return DragMessage.model_validate_json(payload)
    except ValidationError as error:
        problems = (
            f"{'.'.join(map(str, problem['loc'])) or 'message'}: {problem['msg']}, got {quoted(str(problem['input']))}"
            for problem in error.errors(include_url=False)
        )
        raise RequestError("; ".join(problems)) from None
