"""Values of any ROS message type: plausible ones, and those at the limits of what the type can hold.

Values are plain trees of dict, list and scalars, so that they can also be what no message class would take.
"""

import math
from functools import cache

from mjplug_schemas.idl import Primitive
from mjplug_schemas.shape import fields

FLOATS = (
    0.0,
    -0.0,
    1.0,
    -1.0,
    math.nan,
    math.inf,
    -math.inf,
    5e-324,
    -5e-324,
    2.2e-308,
    1.8e308 * 0.999,
    -1.7e308,
    1e10,
    1e11,
    1e-10,
    3.5e38,
    1e100,
    2.0**53,
    0.1,
    1e-9,
    9.2e18,
    1.9e19,
)

TEXTS = (
    "",
    " ",
    "\0",
    "a\0b",
    "link_a\0",
    "\n",
    "\x1b[31mred",
    "é",
    "名前",
    "💥",
    "\u202e",
    "\ufeff",
    "x" * 300,
    "x" * 5000,
    "*",
    "**",
    "a/../b",
    "/",
    "~",
    "%s%n",
    "{}",
    "nan",
    "-1",
    "LINK_A",
    "link_c",
    "'; --",
    "\x7f\x80",
)

WORDS = (
    "base_link",
    "link_a",
    "link_b",
    "upper",
    "lower",
    "post",
    "hand",
    "world",
    "shoulder",
    "elbow",
    "base_joint",
    "apart",
    "sim.speed",
    "sim.paused",
    "sim.seed",
    "sim.clock_rate",
    "sim.on_divergence",
    "use_sim_time",
    "model",
    "sim",
    "max",
    "map",
    "mujoco_ros2_control_msgs/srv/SetPause",
    "std_srvs/srv/Trigger",
    "qpos",
    "sensordata",
    "xpos",
    "/clock",
    "/joint_states",
    "/cmd_vel",
    "begin",
)
"""Names that the world, the parameters and the types have: without them, few inputs would get past the first check."""


class Values:
    """Makes values for one input.

    Args:
        random: The source of randomness of this input.
        wild: How often a value is one of the limits, from 0 to 1.
    """

    def __init__(self, random, wild):
        self._random = random
        self._wild = wild

    def message(self, message_type, depth=0):
        """Returns the fields of a message; some are left out where the type's default will do."""
        random = self._random
        return {
            field.name: self._field(field, depth)
            for field in fields(message_type)
            if depth == 0 or random.random() > 0.1
        }

    def _field(self, field, depth):
        random = self._random
        if field.octets:
            size = field.count if field.kind == "array" else random.choice((0, 1, 3, 100))
            return random.randbytes(size)
        if field.kind == "one":
            return self._one(field, depth)
        size = field.count if field.kind == "array" else random.choice((0, 1, 1, 1, 2, 2, 3, 7))
        if field.kind == "sequence" and isinstance(field.element, Primitive) and random.random() < 0.02 * self._wild:
            size = random.choice((100, 3000))
        items = [self._one(field, depth) for _ in range(size)]
        if items and random.random() < 0.1:
            # The same element several times, as in two wrenches that end together.
            items = [items[0]] * len(items)
        return items

    def _one(self, field, depth):
        if not isinstance(field.element, Primitive):
            return self.message(field.element, depth + 1)
        return self.scalar(field.element)

    def scalar(self, primitive):
        """Returns a value of a primitive type."""
        random, limit = self._random, self._random.random() < self._wild
        if primitive.name in ("string", "wstring"):
            return random.choice(TEXTS) if limit else random.choice(WORDS)
        if primitive.name == "bool":
            return random.random() < 0.5
        if primitive.name.startswith("float"):
            return random.choice(FLOATS) if limit else round(random.uniform(-2.0, 2.0), 3)
        low, high = primitive.limits
        if limit:
            return random.choice((low, high, 0, 1, high // 2, high - 1, low + 1))
        return min(high, max(low, random.choice((0, 0, 0, 1, 1, 2, 3, 4, 10, 1000, 50_000_000))))


def names_of(tree):
    """Yields every path to a leaf of a tree."""
    if isinstance(tree, dict | list):
        for key, item in tree.items() if isinstance(tree, dict) else enumerate(tree):
            for path in names_of(item):
                yield (key, *path)
    else:
        yield ()


@cache
def default_of(message_type):
    """Returns the default of each field of a message type."""
    return message_type()
