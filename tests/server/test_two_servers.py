"""Two servers in one process, at the same time and one after the other: neither changes the other or the program."""

import ctypes
import gc
import logging
import os
import signal
import sys
import textwrap
import threading
from pathlib import Path

import mujoco
import pytest
from conftest import ARM
from waits import until

from mjplug import log_scope, open_server
from mjplug.config.problem import ConfigError
from mjplug.contracts.work import Work
from mjplug.physics import process
from mjplug.physics.process import SWITCH_INTERVAL, _timer_callback
from mjplug.plugin import Parameters, Plugin
from mjplug.shared_change import SharedChange
from mjplug_schemas.std_msgs import String
from mjplug_schemas.std_srvs import Trigger


class TalkerParameters(Parameters):
    word: str


class Talker(Plugin[TalkerParameters]):
    """Logs its word in every possible way."""

    def init(self, host, parameters):
        self.host, self.word = host, parameters.word
        host.create_service(Trigger, "~/talk", self.talk)

    def talk(self, request, call):
        self.host.logger.warning("host: %s", self.word)
        logging.getLogger(__name__).warning("module: %s", self.word)
        logging.getLogger("mjplug.physics.loop").warning("server: %s", self.word)
        own = threading.Thread(target=lambda: self.host.logger.warning("thread: %s", self.word))
        own.start()
        own.join()
        return Trigger.Response(success=True)


def talkers(run):
    return [
        open_server("bundled:box", plugins={"talker": {"type": Talker, "word": word}}, run=run, paused=True)
        for word in ("left", "right")
    ]


@pytest.fixture(params=[True, False], ids=["run", "stepped"])
def pair(request):
    servers = talkers(request.param)
    yield servers
    for server in servers:
        server.stop()


def lines_of(client, count):
    lines = client.subscribe("/rosout", depth=1000)
    return [lines.next(10.0) for _ in range(count)]


def test_each_server_publishes_its_own_log_lines_only(pair, caplog):
    clients = [server.client() for server in pair]
    for client in clients:
        client.call("/talker/talk")
    logging.getLogger("program").warning("of the program")
    logging.getLogger("mjplug.client.graph").warning("of a client of the program")
    for client in clients:
        # A message that cannot be read is refused on a thread of Zenoh.
        client.publisher("/nowhere", String)
        client.session.put("mjplug/set_pause", b"")
        replies = client.session.get("mjplug/set_pause", payload=b"\x00\x01\x00\x00", timeout=10.0)
        assert all(reply.err is not None for reply in replies)
    for client, word in zip(clients, ("left", "right"), strict=True):
        if pair[0]._thread is None:
            client.call("~/get_diagnostics")
        lines = [line.msg for line in lines_of(client, 5)]
        assert lines[:4] == [f"{way}: {word}" for way in ("host", "module", "server", "thread")]
        assert lines[4].startswith("service /mjplug/set_pause: a request was refused (1 so far)")
    assert [record.getMessage() for record in caplog.records].count("module: left") == 1


def test_a_warning_of_mujoco_belongs_to_the_server_whose_thread_it_comes_from(pair):
    warned = []
    assert mujoco.get_mju_user_warning() is not None
    for server, count in ((pair[1], 3), (pair[0], 1)):
        simulation = server._prepared.simulation

        def diverge(simulation=simulation):
            simulation.data.qvel[0] = float("nan")

        for _ in range(count):
            if server._thread is None:
                diverge()
                with pytest.raises(Exception, match="diverged"):
                    server.step()
            else:
                server._opened.server.loop.inbox.post(diverge)
                server.client().call("~/step_simulation", steps=1, check=False)
            server.client().call("~/reset_world")
    for server in pair:
        lines = server.client().subscribe("/rosout", depth=1000)
        said = []
        while not any("diverged" in line for line in said):
            said.append(lines.next(10.0).msg)
        warned.append([line.split(" at ")[0] for line in said if line.startswith("MuJoCo: ")])
    # Each server's first warning of a kind, and no more for some seconds.
    kinds = [f"MuJoCo: Nan, Inf or huge value in {what}" for what in ("QVEL", "QACC")]
    assert warned == [kinds, kinds]


def test_the_warnings_of_mujoco_in_the_programs_own_simulation_stay_the_programs():
    before, heard = mujoco.get_mju_user_warning(), []
    mujoco.set_mju_user_warning(heard.append)
    try:
        with open_server("bundled:box", run=False) as server:
            model = mujoco.MjModel.from_xml_string(ARM)
            data = mujoco.MjData(model)
            data.qvel[0] = float("nan")
            mujoco.mj_step(model, data)
            server.step()
            assert [text.split(" at ")[0] for text in heard] == ["Nan, Inf or huge value in QVEL"]
    finally:
        mujoco.set_mju_user_warning(before)


def process_state():
    """Everything of the process that a server could change and leave behind."""
    loggers = {"": logging.getLogger(), **logging.Logger.manager.loggerDict}
    real = {name: logger for name, logger in loggers.items() if isinstance(logger, logging.Logger)}
    config, timer = mujoco.MjLogConfig.get(), _timer_callback()
    return {
        "handlers": {name: list(logger.handlers) for name, logger in real.items() if logger.handlers},
        "levels": {name: logger.level for name, logger in real.items() if logger.level},
        "disabled": logging.root.manager.disable,
        "sys.path": list(sys.path),
        "switch interval": sys.getswitchinterval(),
        "frozen": gc.get_freeze_count(),
        "signals": {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGCHLD)},
        "wakeup": _wakeup(),
        "environment": dict(os.environ),
        "folder": os.getcwd(),
        "priority": os.getpriority(os.PRIO_PROCESS, 0),
        "slack": ctypes.CDLL(None).prctl(30, 0, 0, 0, 0),
        "mujoco warnings": mujoco.get_mju_user_warning(),
        "mujoco log": (config.logto_file, config.logto_console),
        "mujoco timer": None if timer is None else timer.value,
        "threads": set(threading.enumerate()),
    }


def _wakeup():
    number = signal.set_wakeup_fd(-1)
    signal.set_wakeup_fd(number)
    return number


def open_files():
    return len(os.listdir("/proc/self/fd"))


@pytest.mark.parametrize("run", [True, False], ids=["run", "stepped"])
def test_in_any_order_of_stopping_the_process_is_as_before(run, monkeypatch):
    def theirs(text):
        raise AssertionError(text)

    monkeypatch.setenv("MUJOCO_LOG", "unused")
    # Another test of this process may have configured MuJoCo for good.
    monkeypatch.setattr(process, "_MUJOCO", SharedChange(process._configure_mujoco))
    before_mujoco = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(theirs)
    try:
        # Zenoh starts some of its thread pools, which stay open, with the first connection of the process.
        for server in talkers(run):
            server.client().call("~/get_diagnostics")
            server.stop()
        before, files = process_state(), open_files()
        for order in (1, -1):
            first, second = talkers(run)[::order]
            if run:
                assert sys.getswitchinterval() == pytest.approx(SWITCH_INTERVAL)
            assert mujoco.get_mju_user_warning() is not theirs
            first.stop()
            assert second.client().call("~/get_diagnostics").success
            assert mujoco.get_mju_user_warning() is not theirs
            if run:
                assert sys.getswitchinterval() == pytest.approx(SWITCH_INTERVAL)
            second.stop()
            assert process_state() == before
        # Zenoh closes its files a moment later.
        until(lambda: open_files() <= files)
    finally:
        mujoco.set_mju_user_warning(before_mujoco)


def test_the_log_of_the_program_is_its_own_while_a_server_runs(capsys):
    root = logging.getLogger()
    handlers, level = list(root.handlers), root.level
    for handler in handlers:
        root.removeHandler(handler)
    try:
        with open_server("bundled:box", run=False):
            # Python's handler of last resort prints warnings where nothing is set up.
            logging.getLogger("mjplug.physics.loop").warning("to be seen")
            logging.getLogger("mjplug.physics.loop").info("not to be seen")
            assert capsys.readouterr().err == "to be seen\n"
            logging.basicConfig(format="mine: %(message)s", level=logging.INFO)
            logging.getLogger("mjplug.physics.loop").info("now to be seen")
            assert capsys.readouterr().err == "mine: now to be seen\n"
    finally:
        root.handlers[:] = handlers
        root.setLevel(level)


PLUGIN = """
from mjplug.plugin import Parameters, Plugin
from mjplug.shared_change import SharedChange
from mjplug_schemas.std_srvs import Trigger
import beside_{number}

class Wind(Plugin[Parameters]):
    def init(self, host, parameters):
        host.create_service(Trigger, "~/who", self.who)

    def who(self, request, call):
        import later
        return Trigger.Response(success=True, message=f"{{beside_{number}.NAME}} {{later.NAME}}")
"""


@pytest.fixture
def folders(tmp_path):
    """Two folders, each with a configuration and a plugin module of the same name."""
    made = []
    for number in (1, 2):
        folder = tmp_path / f"robot_{number}"
        folder.mkdir()
        (folder / "robot.yaml").write_text("model: bundled:box\nplugins: {wind: {type: 'wind_here:Wind'}}\n")
        (folder / "wind_here.py").write_text(textwrap.dedent(PLUGIN.format(number=number)))
        (folder / f"beside_{number}.py").write_text(f"NAME = 'wind {number}'\n")
        (folder / "later.py").write_text(f"NAME = 'later {number}'\n")
        made.append(folder)
    yield made
    sys.modules.pop("later", None)


def test_plugins_in_the_folder_of_a_configuration_leave_neither_paths_nor_modules_behind(folders):
    path, modules = list(sys.path), set(sys.modules)
    for number, folder in enumerate(folders, 1):
        with open_server(folder / "robot.yaml", run=False) as server:
            assert str(folder) in sys.path
            assert server.client().call("/wind/who").message == f"wind {number} later {number}"
        assert sys.path == path
        # What a plugin imports while it runs is its own affair.
        assert sys.modules.pop("later").__file__ == str(folder / "later.py")
        assert not {"wind_here", f"beside_{number}"} & (set(sys.modules) - modules)
    # A server opened later gets the module as it is by then.
    (folders[0] / "beside_1.py").write_text("NAME = 'a new and longer wind'\n")
    with open_server(folders[0] / "robot.yaml", run=False) as server:
        assert server.client().call("/wind/who").message == "a new and longer wind later 1"


def test_two_plugin_modules_of_one_name_are_refused_with_the_reason(folders):
    with open_server(folders[0] / "robot.yaml", run=False) as server:
        # Two servers can serve the same file.
        with open_server(folders[0] / "robot.yaml", run=False) as twin:
            assert twin.client().call("/wind/who").message == "wind 1 later 1"
        with pytest.raises(ConfigError) as refused:
            open_server(folders[1] / "robot.yaml", run=False)
        assert f"module 'wind_here' is already imported from {folders[0]}/wind_here.py" in str(refused.value)
        assert f"so {folders[1]}/wind_here.py cannot be imported in the same process; rename one" in str(refused.value)
        assert server.client().call("/wind/who").message == "wind 1 later 1"
        assert str(folders[1]) not in sys.path


class Naming(Work):
    """Publishes which process it runs in."""

    def open(self, model, publishers, logger):
        self._publisher, self._logger = publishers[0], logger
        return ""

    def perform(self, data, job):
        self._publisher.publish(String(data=str(os.getpid())))
        self._logger.warning("performed by %d", os.getpid())
        return os.getpid()


class Delegating(Plugin[Parameters]):
    def init(self, host, parameters):
        from two_servers_work import Naming

        self.pids = []
        publisher = host.create_publisher(String, "~/pid")
        self.worker = host.create_worker(Naming(), [publisher], on_done=lambda job, pid: self.pids.append(pid))
        host.create_service(Trigger, "~/work", self.work)

    def work(self, request, call):
        self.worker.submit(["name"], answered=True)
        return Trigger.Response(success=True)


def alive(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().split()[2] != "Z"
    except OSError:
        return False


def test_each_server_has_worker_processes_of_its_own(tmp_path, monkeypatch):
    source = Path(__file__).read_text(encoding="utf-8")
    work = source[source.index("class Naming") : source.index("class Delegating")]
    imports = "import os\nfrom mjplug.plugin import Work\nfrom mjplug_schemas.std_msgs import String\n\n\n"
    (tmp_path / "two_servers_work.py").write_text(imports + work)
    monkeypatch.syspath_prepend(tmp_path)
    threads = set(threading.enumerate())
    first, second = (open_server("bundled:box", plugins={"name": Delegating}, paused=True) for _ in range(2))
    pids = []
    for server in (first, second):
        client = server.client()
        named, lines = client.subscribe("/name/pid"), client.subscribe("/rosout", depth=1000)
        client.call("/name/work")
        pids.append(int(named.next(60.0).data))
        while (line := lines.next(10.0)).msg != f"performed by {pids[-1]}":
            assert "performed" not in line.msg
    assert pids[0] != pids[1]
    first.stop()
    until(lambda: not alive(pids[0]))
    assert alive(pids[1])
    again = second.client().subscribe("/name/pid")
    second.client().call("/name/work")
    assert int(again.next(60.0).data) == pids[1]
    second.stop()
    until(lambda: not alive(pids[1]))
    assert set(threading.enumerate()) == threads


def test_a_record_of_a_server_can_be_pickled_and_its_logger_too():
    import pickle

    with log_scope.LogScope().active():
        logger = log_scope.logger_of_server("mjplug.instance.lamp")
    record = logger.makeRecord("mjplug.instance.lamp", logging.INFO, "f", 1, "on", (), None)
    assert pickle.loads(pickle.dumps(record.__dict__))["msg"] == "on"
    assert pickle.loads(pickle.dumps(logger)) is logging.getLogger("mjplug.instance.lamp")
    logging.getLogger("mjplug.instance.lamp").setLevel(logging.ERROR)
    assert not logger.isEnabledFor(logging.WARNING)
    logging.getLogger("mjplug.instance.lamp").setLevel(logging.NOTSET)
