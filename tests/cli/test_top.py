"""`mjplug top`: its table, and the command on a server."""

import os
import pty
import re
import subprocess
import sys
import time

import pytest

from mjplug.cli.top_table import lines
from mjplug_schemas.diagnostic_msgs import DiagnosticArray, DiagnosticStatus, KeyValue

SERVER = "/robot1/sim"

STATES = ("/mjplug: running at ", "/mjplug: physics cannot keep up: ")
"""The second where the computer is busy with something else."""


def status(name, level=0, message="ok", server=SERVER, **values):
    entries = [KeyValue(key=key, value=value) for key, value in values.items()]
    return DiagnosticStatus(name=f"sim: {name}", level=level, message=message, hardware_id=server, values=entries)


def shown(*statuses):
    return lines(DiagnosticArray(status=statuses), SERVER)


SIMULATION = {
    "simulated time (s)": "12.345678", "real-time factor": "0.998123", "wanted speed": "1.0", "step rate (Hz)": "999.8",
    "load (%)": "12.3456", "step time p50 (us)": "60.123", "step time p99 (us)": "1234.5", "resets": "3",
    "waiting requests": "2", "contacts": "7", "wall time lost (s)": "0.0001",
}  # fmt: skip


def test_a_table_has_the_simulation_the_plugins_and_the_topics():
    table = shown(
        status("simulation", message="running at 0.998 x real time", **SIMULATION),
        status("wire", message="reachable", **{"open requests": "1", "refused": "0"}),
        status("topics", **{"/clock (Hz)": "100.0", "/tf (Hz)": "49.98765"}),
        status("plugins", **{"camera (%)": "0.001", "camera calls (Hz)": "5.0", "push (%)": "12.0",
                             "push calls (Hz)": "0.0", "push update (us)": "7.5"}),
        status("camera", 1, "restarting: it died", **{"states dropped": "4", "restarts": "1"}),
        status("camera: front"),
        status("simulation", message="another server", server="/other"),
    )  # fmt: skip
    assert [line.text for line in table] == [
        "/robot1/sim: running at 0.998 x real time",
        "time 12.345 s           speed 0.998 (set to 1)  1000 steps/s            load 12.3 %",
        "step p50 60.1 us        p99 1234 us             late p99 ? us           fell behind ? times, <0.01 s lost",
        "resets 3                divergences ?           waiting requests 2      open 1, refused 0       contacts 7",
        "",
        "PLUGIN         % TIME  CALLS/S  UPDATE us  STATE",
        "camera          <0.01        5          -  WARN restarting: it died, states dropped 4, restarts 1",
        "camera: front       -        -          -  ok",
        "push               12        0        7.5  ok",
        "",
        "TOPIC WITH SUBSCRIBERS  MESSAGES/S",
        "/clock                         100",
        "/tf                             50",
    ]
    assert [line.level for line in table if line.level] == [1]
    assert [line.text.split()[0] for line in table if line.heading] == ["PLUGIN", "TOPIC"]


def test_a_table_has_what_was_not_delivered_by_topic_and_service():
    table = shown(
        status("simulation", message="running", **SIMULATION),
        status(
            "wire", **{"refused": "2", "refused on /cmd": "2", "refused as busy": "7", "refused as busy on /push": "7"}
        ),
        status("inbox", **{"waiting": "0", "replaced": "41", "replaced on /cmd": "41"}),
    )
    assert [line.text for line in table][-3:] == [
        "NOT DELIVERED  REFUSED  BUSY  REPLACED",
        "/cmd                 2     0        41",
        "/push                0     7         0",
    ]
    assert not any(line.level for line in table)


def test_errors_are_reported():
    table = shown(
        status("simulation", 2, "the simulation diverged", **SIMULATION),
        status("wire", 1, "a message could not be read"),
    )
    assert (table[0].text, table[0].level) == ("/robot1/sim: the simulation diverged", 2)
    assert [line.text for line in table if line.level == 1] == ["wire: a message could not be read"]
    (nothing,) = shown()
    assert nothing.text == "/robot1/sim: no status of the simulation"


@pytest.mark.parametrize("number", ["inf", "-inf", "nan", "1e999"])
def test_what_is_no_finite_number_is_shown_as_it_is(number):
    table = shown(status("simulation", **{**SIMULATION, "resets": number}), status("topics", **{"/odd (Hz)": number}))
    assert table[3].text.startswith(f"resets {number}  ")
    assert table[-1].text.split() == ["/odd", number]


@pytest.fixture
def served(serve):
    return serve("bundled:box", "--plugin", "heartbeat", "--set", "plugins.heartbeat.update_rate=50.0")


def test_once_shows_a_table_and_ends(served, cli):
    result = cli("top", "--once", "-e", served.endpoint)
    assert (result.returncode, result.stderr) == (0, "")
    assert result.stdout.startswith(STATES)
    assert " x real time" in result.stdout.partition("\n")[0]
    assert re.search(r"^time [\d.]+ s +speed [\d.]+ \(set to 1\) ", result.stdout, re.MULTILINE)
    assert "\033" not in result.stdout


def test_several_times_show_what_has_changed_and_its_subscribers(served, cli):
    result = cli("top", "-n", "3", "-e", served.endpoint)
    assert (result.returncode, result.stderr) == (0, "")
    times = [float(text) for text in re.findall(r"^time ([\d.]+) s", result.stdout, re.MULTILINE)]
    assert len(times) == 3
    assert times[0] < times[1] < times[2]
    assert "/diagnostics" in result.stdout
    assert re.search(r"^heartbeat +[\d<.]+ +[\d<.]+ +-  ok$", result.stdout, re.MULTILINE)


def test_without_a_server_it_reports_an_error(cli):
    result = cli("top", "--once", "-e", "tcp/127.0.0.1:9")
    assert result.returncode == 5
    assert "connection refused by tcp/127.0.0.1:9: no mjplug server listens there" in result.stderr


def test_on_a_terminal_it_has_a_screen_of_its_own_and_gives_it_back(served):
    mine, theirs = pty.openpty()
    process = subprocess.Popen(
        [sys.executable, "-m", "mjplug", "top", "-n", "2", "-e", served.endpoint],
        stdin=theirs, stdout=theirs, stderr=theirs, env={**os.environ, "COLUMNS": "60", "LINES": "20"},
    )  # fmt: skip
    os.close(theirs)
    seen, until = b"", time.monotonic() + 30.0
    while time.monotonic() < until:
        try:
            seen += os.read(mine, 65536)
        except OSError:
            break
    os.close(mine)
    assert process.wait(10.0) == 0
    text = seen.decode()
    assert text.startswith("\033[?1049h\033[?25l")
    assert text.endswith("\033[?25h\033[?1049l")
    pages = text.split("\033[H")[1:]
    assert len(pages) == 2
    for page in pages:
        rows = [re.sub(r"\033\[[0-9;?]*[A-Za-z]", "", row) for row in page.split("\r\n")]
        assert rows[0].startswith(STATES)
        assert max(map(len, rows)) <= 60
        assert len(rows) < 20
