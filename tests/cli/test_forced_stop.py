"""A stop that hangs: the process still ends, its last line names what hung, and nothing is left behind."""

import signal
import subprocess
import time
from pathlib import Path

import pytest
from cli.conftest import WORLD
from cli.process import COMMAND, FREE_PORT, STARTING, Lines, environment
from waits import until

from mjplug.lifecycle.watchdog import FORCED_STOP, STOP_TIME

ENDING = 15.0
"""How long a test waits for a forced stop on a machine with other work [s]; the server's own clock ends it sooner."""

FILE = WORLD / "hanging.py"


@pytest.fixture
def hang(serve):
    """Starts a server with a plugin that hangs."""
    return lambda plugin, *options: serve("scene.xml", "--plugin", f"hanging:{plugin}:culprit", *options, cwd=WORLD)


def line_of(text):
    return FILE.read_text().splitlines().index(text) + 1


def ends(server):
    """Returns the last line of a server that was stopped by force."""
    assert server.end(ENDING) == FORCED_STOP
    return server.err.text.splitlines()[-1]


def forced(what):
    return f"error: the server did not stop within {STOP_TIME:g} s and was ended: {what} did not return"


@pytest.mark.slow
def test_a_plugin_that_never_returns_from_update_is_named_with_its_line(hang):
    server = hang("Updating")
    server.err.wait_for("hanging", STARTING)
    server.process.send_signal(signal.SIGTERM)
    loop = line_of("        while True:")
    # The thread may be in either of the two lines of the loop.
    last = ends(server)
    assert last in [
        forced(f"plugin instance 'culprit' in update ({FILE}, line {line}: {text})")
        for line, text in ((loop, "while True:"), (loop + 1, "pass"))
    ]


def test_a_service_handler_that_sleeps_is_named_and_the_client_gets_an_answer(hang, connect):
    server = hang("Serving", "--paused")
    call = connect(server).request("culprit/hang")
    server.err.wait_for("hanging", STARTING)
    server.process.send_signal(signal.SIGINT)
    what = f"plugin instance 'culprit' in serve ({FILE}, line {line_of('        time.sleep(1e9)')}: time.sleep(1e9))"
    sentence = call.answer().sentence
    assert forced(what) == f"error: {sentence}" == ends(server)


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize(
    ("plugin", "what"),
    [
        ("Timing", "plugin instance 'culprit' in fire ("),
        ("Cleaning", "plugin instance 'culprit' in cleanup ("),
        ("Stepping", "the physics step in advance ("),
        ("Parting", "the Zenoh session in close ("),
        ("Delegating", "the worker process of 'culprit' in end ("),
        ("Remaining", "the thread 'remaining' in remain ("),
    ],
)
def test_what_hangs_is_named(hang, plugin, what, number):
    server = hang(plugin)
    if plugin in ("Timing", "Stepping", "Remaining"):
        server.err.wait_for("hanging", STARTING)
    if plugin == "Stepping":
        # The report can only say that the next step hangs.
        time.sleep(0.5)
    server.process.send_signal(number)
    assert f" and was ended: {what}" in ends(server)


@pytest.mark.slow
def test_a_plugin_that_never_returns_from_init_is_named():
    command = [*COMMAND, "serve", "scene.xml", "--plugin", "hanging:Starting:culprit", *FREE_PORT]
    server = subprocess.Popen(command, cwd=WORLD, env=environment(), stderr=subprocess.PIPE, text=True)
    try:
        log = Lines(server.stderr)
        log.wait_for("hanging", STARTING)
        server.send_signal(signal.SIGINT)
        assert server.wait(ENDING) == FORCED_STOP
        assert " and was ended: plugin instance 'culprit' in init (" in log.wait_for_end().splitlines()[-1]
    finally:
        server.kill()
        server.wait()


def test_a_call_that_keeps_the_gil_is_named_by_its_line(hang):
    server = hang("Hogging")
    server.err.wait_for("hanging", STARTING)
    server.process.send_signal(signal.SIGTERM)
    line = line_of("        collections.deque(itertools.repeat(0), maxlen=0)")
    last = ends(server)
    assert last.endswith(
        f'did not end itself either, and was ended; its physics thread was in: File "{FILE}", line {line} in update'
    )


@pytest.mark.slow
def test_a_hang_at_the_end_of_the_duration_is_bounded_too(hang):
    assert "plugin instance 'culprit' in cleanup (" in ends(hang("Cleaning", "--speed", "max", "--duration", "0.1"))


@pytest.mark.parametrize(("plugin", "code"), [("Updating", -signal.SIGTERM), ("Timing", 128 + signal.SIGTERM)])
def test_a_second_signal_ends_a_server_that_hangs_at_once(hang, plugin, code):
    server = hang(plugin)
    # In C, no handler of Python runs on the physics thread, so the watchdog's thread ends the process.
    server.err.wait_for("hanging", STARTING)
    server.process.send_signal(signal.SIGTERM)
    # Those that come soon after the first count as one with it, and a busy machine may see them late.
    while server.running:
        time.sleep(0.8)
        server.process.send_signal(signal.SIGTERM)
    assert server.end(ENDING) == code
    assert "was ended" not in server.err.text


def test_a_forced_stop_leaves_no_process_and_no_file(hang, tmp_path):
    memory = {path.name for path in Path("/dev/shm").iterdir()}
    ready = tmp_path / "ready.json"
    server = hang("Employing", "--ready-file", str(ready))
    worker = int(server.err.wait_for(r"culprit: worker (\d+)", STARTING)[1])
    children = {
        int(pid)
        for pid in (Path("/proc") / str(server.process.pid) / "task" / str(server.process.pid) / "children")
        .read_text()
        .split()
    }
    server.process.send_signal(signal.SIGTERM)
    assert "plugin instance 'culprit' in cleanup (" in ends(server)
    assert not ready.exists()
    until(lambda: not any(running(pid) for pid in {worker, *children}))
    own = {path.name for path in Path("/dev/shm").iterdir()} - memory
    assert not [name for name in own if str(server.process.pid) in name or str(worker) in name]


def running(pid):
    """Whether a process runs; one that has ended and waits to be reaped does not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def test_a_server_that_stops_in_time_leaves_no_overseer(serve):
    server = serve("bundled:box", "--paused")
    (overseer,) = [
        int(folder.name)
        for folder in Path("/proc").glob("[0-9]*")
        if "overseer_process.py\0" in command(folder) and f"\0{server.process.pid}\0" in command(folder)
    ]
    assert server.stop() == 0
    until(lambda: not running(overseer))


def command(folder):
    try:
        return (folder / "cmdline").read_text()
    except OSError:
        return ""
