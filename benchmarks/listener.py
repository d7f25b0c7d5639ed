"""A subscriber in a separate process, for measurements with a matched publisher."""

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from time import perf_counter, sleep
from typing import Any

from mjplug.contracts.transport import Publisher

START_TIMEOUT = 10.0
"""Timeout for the start of the process [s]."""

_PROGRAM = """
import json, sys, zenoh
config = zenoh.Config()
config.insert_json5("mode", '"client"')
config.insert_json5("connect/endpoints", json.dumps([sys.argv[1]]))
with zenoh.open(config) as session:
    session.declare_subscriber(sys.argv[2], lambda sample: None)
    sys.stdin.read()
"""


@contextmanager
def listening(endpoint: str, key: str, publisher: Publisher[Any]) -> Iterator[None]:
    """Subscribes to a key inside the `with` block, which starts when the publisher is matched."""
    process = subprocess.Popen([sys.executable, "-c", _PROGRAM, endpoint, key], stdin=subprocess.PIPE)
    try:
        deadline = perf_counter() + START_TIMEOUT
        while not publisher.matched:
            assert perf_counter() < deadline
            sleep(0.01)
        yield
    finally:
        process.terminate()
        process.wait(10)
