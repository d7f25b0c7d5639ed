"""Subscribers that are stopped, like a suspended laptop, must not affect other clients."""

import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from cli.process import environment

from mjplug.client import connect

READERS = 5
ANSWER = 6.0
"""How long a call may take on a busy machine [s]. Where stopped readers block the server, it takes 10 s and more."""

GONE = 60.0
"""How long it may take until the server has closed the links of all stopped readers [s]."""

PROGRAM = Path(__file__).with_name("image_network.py")


@pytest.fixture
def start():
    """Starts processes of a network, and returns each with the first line it prints."""
    processes = []

    def start_one(*words):
        process = subprocess.Popen(
            [sys.executable, str(PROGRAM), *words], env=environment(), stdout=subprocess.PIPE, text=True
        )
        processes.append(process)
        return process, process.stdout.readline().strip()

    yield start_one
    for process in reversed(processes):
        process.kill()
        process.communicate()


@pytest.mark.slow
def test_readers_of_images_that_stop_do_not_hold_up_the_calls_of_others(start):
    _, endpoint = start("serve", "tcp/127.0.0.1:0")
    assert start("publish", endpoint)[1] == "publishing"
    readers = [start("read", endpoint, "**", "image") for _ in range(READERS)]
    assert {line for _, line in readers} == {"reading 2"}
    with connect(endpoint, timeout=20.0) as client:
        assert client.call("/links", timeout=ANSWER).message == str(READERS + 2)
        for reader, _ in readers:
            reader.send_signal(signal.SIGSTOP)
        until = time.monotonic() + GONE
        while client.call("/links", timeout=ANSWER).message != "2":
            assert time.monotonic() < until
            time.sleep(0.02)
        # Zenoh closes the sockets once it has tried for 2.5 s to send what was waiting.
        until = time.monotonic() + 5.0
        while time.monotonic() < until:
            client.call("/go", timeout=ANSWER)
            time.sleep(0.02)
