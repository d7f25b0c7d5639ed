"""The second process of a server: it ends one that does not stop, and it ends with it, however that happens."""

import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import pytest
from waits import TIMEOUT, until

from mjplug.lifecycle import overseer_process

TESTS = Path(__file__).parent.parent

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="there is one on Linux only")


class Overseen:
    def __init__(self, case):
        self.process = subprocess.Popen(
            [sys.executable, "-m", "cli.overseen", case],
            cwd=TESTS, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, process_group=0,
        )  # fmt: skip
        self.overseer = int(self.process.stdout.readline())

    def send(self, number):
        self.process.send_signal(number)

    def overseer_ends(self):
        until(lambda: state(self.overseer) in ("gone", "Z"))


@pytest.fixture
def overseen():
    started = []

    def start(case):
        started.append(Overseen(case))
        return started[-1]

    yield start
    for one in started:
        # With the processes that it forked.
        with suppress(ProcessLookupError):
            os.killpg(one.process.pid, signal.SIGKILL)
        one.process.wait()
        one.process.stdout.close()
        one.process.stderr.close()


def state(pid):
    """How a process is: `S` for one that sleeps, `Z` for one that has ended, `gone`."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return "gone"


def ignores(pid, number):
    status = dict(line.split(":\t", 1) for line in Path(f"/proc/{pid}/status").read_text().splitlines())
    return bool(int(status["SigIgn"], 16) >> (number - 1) & 1)


@pytest.mark.parametrize("case", ["waits", "forks", "leaves another signal"])
def test_it_ends_when_the_server_is_killed(overseen, case):
    server = overseen(case)
    server.send(signal.SIGKILL)
    server.overseer_ends()


@pytest.mark.parametrize("case", ["hangs", "leaves a stop"])
def test_it_ends_a_server_that_does_not_stop_with_the_exit_code_and_the_place(overseen, case):
    server = overseen(case)
    assert server.process.wait(TIMEOUT) == 40
    server.overseer_ends()
    sentence = server.process.stderr.read()
    assert sentence.startswith(
        "error: the server did not stop within 0.3 s, did not end itself either, and was ended; "
    )
    line = (TESTS / "cli" / "overseen.py").read_text().splitlines().index("    time.sleep(1e9)") + 1
    assert sentence.endswith(f'overseen.py", line {line} in main\n')


@pytest.mark.parametrize(("told", "ends"), [(b"", False), (b"s", False), (b"f", True), (b"sf", True)])
def test_it_knows_from_the_pipe_whether_the_server_ends_itself(told, ends):
    reader, writer = os.pipe()
    try:
        os.write(writer, told)
        assert overseer_process.Server(-1, None, reader, -1, 0, 0, 0).ends_itself() is ends
    finally:
        os.close(reader)
        os.close(writer)


def test_it_ends_a_suspended_server_that_was_about_to_end(overseen):
    server = overseen("is suspended")
    assert server.process.wait(TIMEOUT) == -signal.SIGKILL
    server.overseer_ends()


def test_it_ends_when_the_server_dies_while_it_writes_down_where_its_threads_are(overseen):
    server = overseen("dies at the dump")
    assert server.process.wait(TIMEOUT) == -41
    server.overseer_ends()


def test_a_suspended_server_without_a_stop_request_is_left_alone(overseen):
    server = overseen("waits")
    server.send(signal.SIGSTOP)
    time.sleep(1.0)
    assert state(server.process.pid) == "T"
    assert state(server.overseer) == "S"


def test_it_outlives_the_signals_that_stop_the_server(overseen):
    server = overseen("waits")
    numbers = (signal.SIGTERM, signal.SIGINT, signal.SIGHUP)
    until(lambda: all(ignores(server.overseer, number) for number in numbers))
    for number in numbers:
        os.kill(server.overseer, number)
    time.sleep(0.2)
    assert state(server.overseer) not in ("gone", "Z")
    server.send(signal.SIGKILL)
    server.overseer_ends()


def test_it_does_not_watch_another_process_that_has_the_servers_number():
    # This process represents the other one: it is not the parent of the program.
    words = [overseer_process.__file__, os.getpid(), 0.0, *[0] * 6]
    with subprocess.Popen(["sh", "-c", '"$@"; exit $?', "sh", sys.executable, *map(str, words)]) as program:
        assert program.wait(TIMEOUT) == 0


def test_it_finds_the_physics_thread_in_what_faulthandler_writes():
    dump = (
        'Thread 0x00007f0000000001 (most recent call first):\n  File "/a.py", line 1 in wait\n\n'
        "Current thread 0x00007f0000000002 (most recent call first):\n"
        '  File "/b.py", line 22 in spin\n  File "/c.py", line 3 in run\n'
    )
    assert overseer_process.place(dump, 0x7F0000000002) == 'its physics thread was in: File "/b.py", line 22 in spin'
    assert overseer_process.place(dump, 0x7F0000000003) == "its Python code had ended, so a library did not end"
    assert overseer_process.place("", 1) == "its Python code had ended, so a library did not end"
