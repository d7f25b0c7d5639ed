"""The attackers in short: `make fuzz` and `make soak` run them for longer."""

import subprocess
import sys
from pathlib import Path

import pytest
from hostile import decoders, full_disk, in_process, saved_states, server_kills, soak, stopped_callers, wire
from hostile.attack import random_of
from machine import lacking

proc = pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="looks for memory and processes in /proc")


@proc
def test_hostile_bytes_into_a_server_without_a_socket_are_refused_or_right():
    assert in_process.main(["--count", "750", "--seconds", "40"]) == 0


def test_hostile_files_of_saved_states_are_refused_or_restored():
    assert saved_states.main(["--count", "100", "--seconds", "40"]) == 0


@proc
def test_hostile_inputs_over_the_wire_are_all_answered_once():
    assert wire.main(["--count", "500", "--seconds", "40"]) == 0


@proc
def test_hostile_configurations_and_models_end_with_a_sentence():
    # In a separate process, because it forks, and the test process has threads.
    command = [sys.executable, "-m", "hostile.configuration", "--count", "20", "--seconds", "40", "--processes", "0"]
    ended = subprocess.run(command, cwd=Path(__file__).parents[1], capture_output=True, text=True, check=False)
    assert ended.returncode == 0, ended.stdout + ended.stderr


@proc
@pytest.mark.slow
@pytest.mark.timeout(400)
def test_clients_of_a_killed_server_get_errors_and_the_next_server_takes_over():
    assert server_kills.main(["--count", "4", "--seconds", "300"]) == 0


@proc
@pytest.mark.slow
@pytest.mark.timeout(400)
def test_stopped_clients_do_not_delay_others():
    assert stopped_callers.main(["--count", "2", "--seconds", "300"]) == 0


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_commands_on_a_full_disk_report_it_and_leave_nothing_behind():
    if reason := full_disk.permitted():
        lacking(reason)
    assert full_disk.main(["--count", "10", "--seconds", "500"]) == 0


@proc
@pytest.mark.timeout(170)
def test_the_memory_of_a_busy_server_does_not_grow():
    assert soak.main(["--seconds", "4", "--no-camera", "--no-kills"]) == 0


def test_random_bytes_are_refused_by_every_decoder_or_come_out_the_same():
    random, types = random_of(0, 0), decoders.message_types()
    for _ in range(300):
        for form in (b"\0", b"\1"):
            header = random.choice((b"\0\1\0\0", b"\0\0\0\0", b"{", b""))
            decoders.try_one(types, random.randbytes(1) + form + header + random.randbytes(random.randrange(80)))
