"""What hostile clients send, and what must come of it: a refusal, and nothing else."""

import random

from cli.client import wrench, wrenches
from refusals import refusal_in

from mjplug_schemas.registry import find

FREE_BODY = {
    "name": "link_a",
    "pose": {"pose": {"position": {"x": 1.0, "y": 2.0, "z": 3.0}, "orientation": {"x": 0, "y": 0, "z": 0, "w": 1.0}}},
    "twist": {"twist": {"linear": {"x": 0.0, "y": 0.0, "z": 0.0}, "angular": {"x": 0.0, "y": 0.0, "z": 0.0}}},
}
VALID = {
    "external_wrench/apply_wrench": wrenches(wrench("link_b", force=(1.0, 2.0, 3.0), seconds=0.1, ramp=0.05)),
    "mjplug/set_free_joint_state": {"free_joints": [FREE_BODY]},
    "mjplug/reset_world": {
        "keyframe": "apart",
        "state_overrides": {
            "joint_states": {"name": ["hinge"], "position": [0.1], "velocity": [0.2]},
            "free_joints": [FREE_BODY],
        },
    },
    "mjplug/step_simulation": {"steps": 1},
    "mjplug/set_pause": {"paused": True},
}
"""A request to each service that would take effect if it were not for the one thing that a test puts in."""


def effects(world):
    """The state that a request could change; without gravity and velocity, nothing moves by itself."""
    state = world.state()
    return {name: state[name] for name in ("qpos", "qvel", "xfrc", "epoch")}


def refused(pending):
    """Waits for the answer, which must be a refusal with a sentence; returns the sentence."""
    answer = pending.answer()
    if answer.encoding.startswith("application/cdr"):
        response = find(answer.encoding.partition(";")[2].removesuffix("_Response")).Response.from_cdr(answer.payload)
        sentence = refusal_in(response)
        assert sentence is not None, response
    else:
        sentence = answer.sentence
    assert 5 < len(sentence) < 5000
    return sentence


def garbage():
    """Payloads that are no request of any kind."""
    random_bytes = random.Random(0).randbytes
    yield from (random_bytes(size) for size in (1, 3, 4, 5, 100, 5000))
    yield from (b"\0\1\0\0" + random_bytes(size) for size in (17, 100, 5000))
    yield from (b"\0\0\0\0" + random_bytes(size) for size in (17, 100, 5000))
    # Counts and lengths of four billion.
    yield from (header + b"\xff" * size for header in (b"\0\0\0\0", b"\0\1\0\0") for size in (8, 400))
    yield b"\0\3\0\0" + bytes(40)
    yield from (
        b"[]",
        b"null",
        b"1",
        b'"text"',
        b"true",
        b"{",
        b'{"',
        b"{]",
        b"\xff\xfe{}",
        b"{}{}",
        b'{"a": 1}',
        b"{1: 2}",
    )
    yield from (b"[" * 100_000, b'{"a":' * 100_000, b'{"wrenches":' * 10_000 + b"1" + b"}" * 10_000)
    yield b'{"paused": tru'
    yield b'{"\\ud800": 1}'
    yield b'{"steps": 1' + b"0" * 5000 + b"}"


def paths(value, kinds, path=()):
    """Yields the path of every leaf of some types."""
    if isinstance(value, dict | list):
        for name, item in value.items() if isinstance(value, dict) else enumerate(value):
            yield from paths(item, kinds, (*path, name))
    elif isinstance(value, kinds) and not (isinstance(value, bool) and bool not in kinds):
        yield path


def replaced(value, path, new):
    """Returns a copy with another value at a path."""
    if not path:
        return new
    if isinstance(value, list):
        return [replaced(item, path[1:], new) if i == path[0] else item for i, item in enumerate(value)]
    return {**value, path[0]: replaced(value[path[0]], path[1:], new)}
