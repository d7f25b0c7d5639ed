"""The keys of `mjplug teleop`, which are those of teleop_twist_keyboard, and the velocity that they give."""

import re
from dataclasses import dataclass
from typing import Final

_STEP = 1.1, 0.9
"""Factors by which a key changes a speed."""

DIRECTIONS: Final[dict[str, tuple[int, int, int, int]]] = {
    "i": (1, 0, 0, 0), ",": (-1, 0, 0, 0), "j": (0, 0, 0, 1), "l": (0, 0, 0, -1),
    "u": (1, 0, 0, 1), "o": (1, 0, 0, -1), "m": (-1, 0, 0, -1), ".": (-1, 0, 0, 1),
    "I": (1, 0, 0, 0), "<": (-1, 0, 0, 0), "J": (0, 1, 0, 0), "L": (0, -1, 0, 0),
    "U": (1, 1, 0, 0), "O": (1, -1, 0, 0), "M": (-1, 1, 0, 0), ">": (-1, -1, 0, 0),
    "t": (0, 0, 1, 0), "b": (0, 0, -1, 0),
}  # fmt: skip
"""For each key: the signs of the velocities along x, y and z, and of the yaw rate."""

_ARROWS = {"A": "i", "B": ",", "C": "l", "D": "j"}
"""Arrow keys by the last character of their escape sequence, and the keys that do the same."""

SPEEDS: Final[dict[str, tuple[float, float]]] = {
    "q": (_STEP[0], _STEP[0]), "z": (_STEP[1], _STEP[1]),
    "w": (_STEP[0], 1.0), "x": (_STEP[1], 1.0),
    "e": (1.0, _STEP[0]), "c": (1.0, _STEP[1]),
}  # fmt: skip
"""For each key: the factors for the linear speed and the yaw rate."""

_KEY = re.compile(r"\x1b[\[O][0-9;]*([A-Za-z~])|\x1b.?|.", re.DOTALL)

HELP = """\
Moving:                    With the Shift key, sideways:
   u    i    o                U    I    O
   j    k    l                J    K    L
   m    ,    .                M    <    >

t / b : up / down          arrow keys : like i , j l
any other key : stop

q / z : both speeds 10 % higher / lower
w / x : only the linear speed
e / c : only the yaw rate

Ctrl-C : stop and exit
"""


def keys(text: str) -> list[str]:
    """Returns the keys in what a terminal has sent: one character each; an unknown escape sequence is one empty key."""
    found = []
    for match in _KEY.finditer(text):
        arrow = _ARROWS.get(match[1] or "", "") if re.fullmatch(r"\x1b[\[O][A-D]", match[0]) else ""
        found.append(arrow if match[0].startswith("\x1b") else match[0])
    return found


@dataclass
class Drive:
    """The velocity that the keys have chosen.

    Attributes:
        speed: Linear speed in each direction [m/s].
        turn: Yaw rate [rad/s].
        direction: Signs of the velocities along x, y and z, and of the yaw rate.
    """

    speed: float
    turn: float
    direction: tuple[int, int, int, int] = (0, 0, 0, 0)

    def press(self, key: str) -> None:
        """Follows a key; any key without a meaning stops."""
        if key in SPEEDS:
            linear, angular = SPEEDS[key]
            self.speed *= linear
            self.turn *= angular
        else:
            self.direction = DIRECTIONS.get(key, (0, 0, 0, 0))

    def stop(self) -> None:
        """Sets the velocity to zero."""
        self.direction = (0, 0, 0, 0)

    @property
    def moving(self) -> bool:
        """Whether the velocity is not zero."""
        return any(self.direction)

    @property
    def velocity(self) -> tuple[float, float, float, float]:
        """Velocity along x, y and z [m/s], and yaw rate [rad/s]."""
        x, y, z, yaw = self.direction
        return x * self.speed, y * self.speed, z * self.speed, yaw * self.turn

    @property
    def text(self) -> str:
        """The speeds and the velocity on one line."""
        speeds = f"speed {self.speed:.3g} m/s, turn {self.turn:.3g} rad/s"
        if not self.moving:
            return f"{speeds}: stopped"
        x, y, z, yaw = self.velocity
        parts = [f"{name} {value:+.3g}" for name, value in (("x", x), ("y", y), ("z", z), ("yaw", yaw)) if value]
        return f"{speeds}: {', '.join(parts)}"
