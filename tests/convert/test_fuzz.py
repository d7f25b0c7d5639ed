"""Damaged URDFs: each conversion ends with a model or with one sentence, in bounded time."""

import random
import re
import time

import pytest

from convert.robots import ARM, ROVER, converted
from convert.test_sensors_served import URDF
from mjplug.errors import ModelError

SEEDS = (ARM, ROVER, URDF)
VALUES = (
    "", "0", "-1", "nan", "inf", "1e308", "-1e308", "1e-320", "abc", "1 2", "1 2 3", "1 2 3 4", "0 0 0", "world",
    "base", "../../x", "é", "&#10;", "&quot;", "9" * 21, "true", "x" * 300, "package://", "file:///",
)  # fmt: skip
TIME_LIMIT = 60.0
"""Longest conversion on a busy machine; on an idle one it takes less than 1 s."""


def cut(text, rng):
    return text[: rng.randrange(len(text))]


def value(text, rng):
    found = rng.choice(list(re.finditer(r'="([^"]*)"', text)))
    return text[: found.start(1)] + rng.choice(VALUES) + text[found.end(1) :]


def content(text, rng):
    found = list(re.finditer(r">([^<>]+)<", text))
    if not found:
        return text
    chosen = rng.choice(found)
    return text[: chosen.start(1)] + rng.choice(VALUES) + text[chosen.end(1) :]


def character(text, rng):
    at = rng.randrange(len(text))
    return text[:at] + chr(rng.randrange(1, 0x2FF)) + text[at + 1 :]


def attribute(text, rng):
    found = rng.choice(list(re.finditer(r' \w+="[^"]*"', text)))
    return text[: found.start()] + text[found.end() :]


def element(text, rng):
    """Removes or repeats an element."""
    found = list(re.finditer(r"<(\w+)\b[^<>]*(/>|>.*?</\1>)", text[1:]))
    if not found:
        return text
    chosen = rng.choice(found)
    return text[: chosen.start() + 1] + chosen[0] * rng.choice((0, 2)) + text[chosen.end() + 1 :]


CHANGES = (cut, value, value, content, character, attribute, element, element)


def changed(seed):
    rng = random.Random(seed)
    text = rng.choice(SEEDS)
    for _ in range(rng.choice((1, 1, 2, 4))):
        try:
            text = rng.choice(CHANGES)(text, rng)
        except (IndexError, ValueError):
            break
    return text


def check(tmp_path, seeds):
    accepted = 0
    for seed in seeds:
        begin = time.process_time()
        try:
            converted(tmp_path, changed(seed))
            accepted += 1
        except ModelError as error:
            message = str(error)
            assert message.startswith(str(tmp_path)), seed
            assert "\n" not in message, seed
            assert len(message) < 1500, seed
        except Exception as error:
            raise AssertionError(f"seed {seed}: {type(error).__name__}: {error}") from error
        assert time.process_time() - begin < TIME_LIMIT, seed
    return accepted


@pytest.mark.filterwarnings("error")
def test_damaged_robots_end_in_one_sentence_or_in_a_model(tmp_path):
    assert 5 < check(tmp_path, range(60)) < 55


@pytest.mark.slow
@pytest.mark.timeout(1200)
@pytest.mark.filterwarnings("error")
def test_many_damaged_robots_end_in_one_sentence_or_in_a_model(tmp_path):
    assert check(tmp_path, range(1000, 4000)) > 300
