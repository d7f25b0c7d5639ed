"""What an exception in a plugin's code does, and `sys.exit()` in it, under both values of `on_plugin_error`."""

import signal
import sys

import pytest

from mjplug.config.settings import Settings
from mjplug.errors import PluginError
from mjplug.physics.reset import Reset
from mjplug.physics.simulation import Simulation
from mjplug.plugin import Diagnosis, Parameters, Plugin
from mjplug.plugin.selection import Selected
from mjplug.server.offline import OfflineWorkerPool
from mjplug.server.server import Server
from mjplug.testing import FakeTransport
from mjplug_schemas.std_msgs import String
from mjplug_schemas.std_srvs import Trigger


class Hooked(Plugin[Parameters]):
    """Raises in the hook that a test names."""

    hook = ""
    error: BaseException = SystemExit(3)

    def init(self, host, parameters):
        self.updates = 0
        host.create_subscription(String, "/words", lambda message: self.work("subscription"))
        host.create_timer(0.01, lambda: self.work("timer"))
        host.create_service(Trigger, "/immediate", lambda request, call: self.answer("immediate"))
        host.create_service(Trigger, "/slow", lambda request, call: self.slowly(host))
        host.create_diagnostic("", self.diagnose)
        host.activate()
        self.work("init")

    def update(self):
        self.updates += 1
        self.work("update")

    def on_reset(self):
        self.work("on_reset")

    def cleanup(self):
        self.work("cleanup")

    def answer(self, hook):
        self.work(hook)
        return Trigger.Response(success=True)

    def slowly(self, host):
        yield host.step + 3
        return self.answer("slow")

    def diagnose(self):
        self.work("diagnostic")
        return Diagnosis()

    def work(self, hook):
        if hook == self.hook:
            raise self.error


@pytest.fixture
def serve(arm_model):
    servers = []

    def start(policy):
        settings = Settings.model_validate({"model": "x.xml", "on_plugin_error": policy, "sim": {"speed": "max"}})
        transport = FakeTransport()
        selected = [Selected("hooked", Hooked, Parameters())]
        servers.append(Server(settings, Simulation(arm_model), transport, selected, OfflineWorkerPool()))
        return servers[-1], transport

    yield start
    for server in servers:
        server.cleanup()


ERRORS = [SystemExit(3), ZeroDivisionError("on purpose"), KeyboardInterrupt()]


@pytest.fixture(params=ERRORS, ids=lambda error: type(error).__name__)
def error(request, monkeypatch):
    monkeypatch.setattr(Hooked, "error", request.param)
    # As the command line does: Ctrl-C stops the loop, so that a KeyboardInterrupt can come from a plugin only.
    before = signal.signal(signal.SIGINT, lambda *_: None)
    yield request.param
    signal.signal(signal.SIGINT, before)


def provoke(server, transport, hook):
    if hook == "subscription":
        transport.send("/words", String())
    elif hook == "on_reset":
        server.loop.inbox.post(lambda: server.loop.reset(Reset()))


@pytest.mark.parametrize("hook", ["update", "timer", "on_reset", "subscription"])
def test_under_stop_the_server_ends_with_the_name_of_the_plugin_and_the_error(serve, monkeypatch, hook, error):
    monkeypatch.setattr(Hooked, "hook", hook)
    server, transport = serve("stop")
    provoke(server, transport, hook)
    with pytest.raises(PluginError, match=r"plugin hooked failed: .* \(on_plugin_error: stop\)") as raised:
        server.run(duration=1.0)
    assert repr(error) in str(raised.value)
    assert server.loop.simulation.step <= 5


@pytest.mark.parametrize("hook", ["update", "timer", "on_reset", "subscription"])
def test_under_disable_the_plugin_is_switched_off_once_and_the_server_continues(
    serve, monkeypatch, caplog, hook, error
):
    monkeypatch.setattr(Hooked, "hook", hook)
    server, transport = serve("disable")
    for _ in range(50):
        provoke(server, transport, hook)
    server.run(duration=0.2)
    assert server.loop.simulation.step == 100
    assert server.plugins["hooked"].updates <= 5
    assert len([record for record in caplog.records if record.exc_info]) == 1
    call = transport.call("/immediate")
    server.loop.step(0)
    assert call.refusal == f"plugin hooked was disabled after an error: {error!r}"


@pytest.mark.parametrize("hook", ["immediate", "slow"])
@pytest.mark.parametrize("policy", ["stop", "disable"])
def test_an_error_in_a_service_goes_to_its_client_and_the_plugin_continues(serve, monkeypatch, hook, policy, error):
    monkeypatch.setattr(Hooked, "hook", hook)
    server, transport = serve(policy)
    call = transport.call(f"/{hook}")
    server.run(duration=0.2)
    assert call.refusal == f"internal error: {error!r}"
    assert server.plugins["hooked"].updates == 100


@pytest.mark.parametrize("hook", ["immediate", "slow"])
def test_a_service_that_fails_each_time_does_not_fill_the_log(serve, monkeypatch, caplog, hook):
    monkeypatch.setattr(Hooked, "hook", hook)
    server, transport = serve("stop")
    calls = [transport.call(f"/{hook}") for _ in range(500)]
    server.run(duration=0.2)
    assert all(call.refusal == "internal error: SystemExit(3)" for call in calls)
    assert 1 <= len([record for record in caplog.records if record.exc_info]) < 10


def test_an_error_in_init_refuses_the_start(serve, monkeypatch, error):
    monkeypatch.setattr(Hooked, "hook", "init")
    with pytest.raises(PluginError, match="plugin hooked failed to start: "):
        serve("disable")


def test_an_error_in_cleanup_is_logged(serve, monkeypatch, caplog, error):
    monkeypatch.setattr(Hooked, "hook", "cleanup")
    server, _ = serve("stop")
    server.run(duration=0.1)
    assert "plugin hooked failed while it was cleaned up" in caplog.text


def test_an_error_in_a_diagnostic_is_that_status(serve, monkeypatch, error):
    monkeypatch.setattr(Hooked, "hook", "diagnostic")
    server, _ = serve("stop")
    assert server.diagnostics.diagnose()["hooked"].message == f"its diagnostic task failed: {error!r}"


def test_a_real_ctrl_c_ends_a_script_that_runs_a_server(serve, monkeypatch):
    """With Python's handler of SIGINT, KeyboardInterrupt stops the server wherever it is raised."""
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    monkeypatch.setattr(Hooked, "hook", "update")
    monkeypatch.setattr(Hooked, "error", KeyboardInterrupt())
    server, _ = serve("disable")
    with pytest.raises(KeyboardInterrupt):
        server.run(duration=1.0)


def test_sys_exit_itself_is_contained(serve, monkeypatch):
    monkeypatch.setattr(Hooked, "update", lambda self: sys.exit("enough"))
    server, _ = serve("disable")
    server.run(duration=0.1)
    assert server.loop.simulation.step == 50
