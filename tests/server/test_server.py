import pytest

from mjplug.config.settings import Settings
from mjplug.errors import PluginError
from mjplug.physics.simulation import Simulation
from mjplug.plugin import Parameters, Plugin, RequestError
from mjplug.plugin.selection import Selected
from mjplug.server.offline import OfflineWorkerPool
from mjplug.server.server import Server
from mjplug.testing import FakeTransport

EVENTS = []
SERVERS = []


@pytest.fixture(autouse=True)
def _no_events():
    EVENTS.clear()
    yield
    while SERVERS:
        SERVERS.pop().cleanup()


class Good(Plugin[Parameters]):
    def init(self, host, parameters):
        self.name = host.name
        EVENTS.append(f"init {self.name}")

    def cleanup(self):
        EVENTS.append(f"cleanup {self.name}")


class Refusing(Plugin[Parameters]):
    def init(self, host, parameters):
        raise RequestError("no such body")

    def cleanup(self):
        EVENTS.append("cleanup refusing")


class Broken(Plugin[Parameters]):
    def init(self, host, parameters):
        raise ZeroDivisionError("oops")


def serve(model, *plugins, **settings):
    settings = Settings.model_validate({"model": "x.xml", **settings})
    transport = FakeTransport()
    selected = [Selected(name, plugin, Parameters()) for name, plugin in plugins]
    SERVERS.append(Server(settings, Simulation(model), transport, selected, OfflineWorkerPool()))
    return SERVERS[-1], transport


def test_the_server_offers_its_services_under_its_own_name(arm_model):
    _, transport = serve(arm_model)
    control = {"set_pause", "step_simulation", "step", "rollout", "reset_world", "set_free_joint_state"}
    control |= {"save_state", "restore_state", "list_states", "delete_state", "get_state_digest"}
    parameters = {
        "describe_parameters", "get_parameter_types", "get_parameters", "list_parameters", "set_parameters",
        "set_parameters_atomically",
    }  # fmt: skip
    states = {"save_state", "restore_state", "list_states", "delete_state", "get_state_digest"}
    own = {name for name in transport.services if name.startswith("/mjplug/")}
    assert own == {f"/mjplug/{name}" for name in control | parameters | states | {"get_diagnostics"}}
    published = {name for name in transport.publishers if "/_action/" not in name}
    assert published == {"/clock", "/diagnostics", "/mjplug/epoch", "/rosout"}


def test_namespace_node_name_and_remapping_shape_every_name(arm_model):
    _, transport = serve(
        arm_model,
        namespace="robot1",
        node_name="sim",
        remap={"/robot1/sim/set_pause": "/halt", "/clock": "/robot1/clock"},
    )
    assert "/halt" in transport.services
    assert "/robot1/sim/reset_world" in transport.services
    assert "/robot1/clock" in transport.publishers


def test_plugins_start_in_order_and_are_cleaned_up_in_reverse(arm_model):
    server, _ = serve(arm_model, ("a", Good), ("b", Good), sim={"speed": "max"})
    server.run(duration=0.1)
    assert EVENTS == ["init a", "init b", "cleanup b", "cleanup a"]


def test_a_run_of_a_given_duration_takes_exactly_its_steps(arm_model):
    server, _ = serve(arm_model, sim={"speed": "max"})
    server.run(duration=1.2345)
    assert server.loop.simulation.step == 618


def test_a_plugin_that_refuses_stops_the_start_and_the_others_are_cleaned_up(arm_model):
    with pytest.raises(PluginError, match="plugin b refused to start: no such body"):
        serve(arm_model, ("a", Good), ("b", Refusing), ("c", Good))
    assert EVENTS == ["init a", "init c", "cleanup c", "cleanup refusing", "cleanup a"]


def test_what_every_plugin_refuses_is_reported_at_once(arm_model):
    with pytest.raises(PluginError) as refused:
        serve(arm_model, ("a", Refusing), ("b", Good), ("c", Broken), ("d", Refusing))
    assert str(refused.value) == (
        "3 plugins did not start:\n"
        "  plugin a refused to start: no such body\n"
        "  plugin c failed to start: ZeroDivisionError('oops')\n"
        "  plugin d refused to start: no such body"
    )


def test_a_plugin_that_breaks_while_starting_is_named_and_logged(arm_model, caplog):
    with pytest.raises(PluginError, match="plugin b failed to start: ZeroDivisionError"):
        serve(arm_model, ("b", Broken))
    assert caplog.records[-1].exc_info


def test_open_requests_are_answered_when_the_server_stops(arm_model):
    server, transport = serve(arm_model, sim={"speed": "max", "paused": True})
    call = transport.call("/mjplug/step_simulation", transport.types["/mjplug/step_simulation"].Request(steps=10**9))
    server.loop.step(0)
    server.loop.inbox.post(server.loop.stop)
    server.run()
    assert call.refusal == "cancelled: the server is stopping"
