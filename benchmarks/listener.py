"""A subscriber in a process of its own: what a message costs when somebody listens."""

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from time import perf_counter, sleep
from typing import Any

from mjplug.contracts.transport import Publisher

PATIENCE = 10.0
"""How long the process may take to start [s]."""

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
    """Subscribes to a key until the block ends; begins when the publisher knows of it."""
    process = subprocess.Popen([sys.executable, "-c", _PROGRAM, endpoint, key], stdin=subprocess.PIPE)
    try:
        deadline = perf_counter() + PATIENCE
        while not publisher.matched:
            assert perf_counter() < deadline
            sleep(0.01)
        yield
    finally:
        process.terminate()
        process.wait(10)
