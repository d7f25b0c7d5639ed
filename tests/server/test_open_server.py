"""`mjplug.open_server`: its arguments, and how a server is opened."""

import threading
from queue import Queue

import numpy as np
import pytest
from echo_plugin import Echo
from scripts import run_script
from waits import TIMEOUT

from mjplug import open_server
from mjplug.client import ClientError, connect
from mjplug.config.problem import ConfigError
from mjplug.errors import MjplugError, ModelError, PluginError, RequestError
from mjplug.plugin import Parameters, Plugin
from mjplug_schemas.std_msgs import String


def settings_of(server):
    return server._prepared.loaded.settings


def test_a_running_server_answers_its_client_and_is_stopped_after_the_block():
    with open_server("bundled:box", plugins=["heartbeat"]) as server:
        assert (server.name, server.running) == ("/mjplug", True)
        client = server.client()
        assert client.call("~/set_pause", paused=True).message == "the simulation is now paused"
        assert "/mujoco_heartbeat" in client.topics()
        with connect(server.endpoint) as other:
            assert other.call("~/step_simulation", steps=3).success
    assert not server.running
    with pytest.raises(ClientError, match="closed"):
        client.topics()
    with pytest.raises(ClientError, match="connection refused by "):
        connect(server.endpoint, timeout=0.0)
    server.stop()


def test_only_the_physics_thread_sends_replies_itself_and_only_while_it_takes_no_steps():
    with open_server("bundled:box", paused=True) as server, server.client() as client:
        replies, inbox = server._opened.network.open_calls.replies, server._opened.server.loop.inbox

        def may_wait():
            answer = Queue()
            inbox.post(lambda: answer.put(replies.may_wait()))
            return answer.get(timeout=60.0)

        assert (replies.may_wait(), may_wait()) == (False, True)
        goals = server._opened.server.loop.goals
        inbox.post(lambda: goals.add(0, 1 << 40))
        assert may_wait() is False
        inbox.post(lambda: goals.cancel("test"))
        assert may_wait() is True
        client.call("~/set_pause", paused=False)
        assert (replies.may_wait(), may_wait()) == (False, False)


def test_a_server_listens_on_a_free_port_of_this_machine_unless_configured_otherwise(tmp_path, monkeypatch):
    monkeypatch.delenv("MJPLUG_ZENOH__LISTEN", raising=False)
    with open_server("bundled:box", run=False) as one, open_server("bundled:box", run=False) as other:
        assert one.endpoint.startswith("tcp/127.0.0.1:")
        assert one.endpoint != other.endpoint
        with open_server("bundled:box", run=False, connect=one.endpoint, settings={"node_name": "guest"}) as guest:
            assert guest.endpoint == one.endpoint
            with connect(one.endpoint, server="/guest") as client:
                assert set(client.nodes()) == {"/mjplug", "/guest"}
    file = tmp_path / "robot.yaml"
    file.write_text("model: bundled:box\nzenoh: {listen: ['tcp/localhost:0']}\n")
    with open_server(file, run=False) as server:
        assert server.endpoint.startswith("tcp/localhost:")
    with open_server(file, run=False, listen="tcp/127.0.0.1:0") as server:
        assert server.endpoint.startswith("tcp/127.0.0.1:")
    monkeypatch.setenv("MJPLUG_ZENOH__LISTEN", "[tcp/localhost:0]")
    with open_server("bundled:box", run=False) as server:
        assert server.endpoint.startswith("tcp/localhost:")


def test_arguments_outrank_variables_and_these_the_configuration(tmp_path, monkeypatch):
    monkeypatch.setenv("MJPLUG_SIM__SPEED", "3")
    monkeypatch.setenv("MJPLUG_SIM__SEED", "4")
    config = {"model": "bundled:arm", "sim": {"speed": 2, "seed": 2, "clock_rate": 20}}
    with open_server(config, speed="max", keyframe=0, run=False, settings={"namespace": "/left"}) as server:
        sim = settings_of(server).sim
        assert (sim.speed, sim.seed, sim.clock_rate, sim.keyframe) == ("max", 4, 20.0, "0")
        assert server.name == "/left/mjplug"


def test_a_mapping_is_read_as_a_configuration_file(arm, monkeypatch):
    monkeypatch.chdir(arm.parent)
    config = {
        "model": "arm.xml",
        "sim": {"keyframe": "bent", "initial_positions": {"shoulder": np.float64(0.25)}},
        "plugins": {"echo": {"type": "echo_plugin:Echo"}, "pulse": {"type": "heartbeat", "update_rate": 2}},
        "remap": {"/clock": "/time"},
    }
    with open_server(config, run=False) as server:
        assert [*settings_of(server).plugins] == ["echo", "pulse"]
        assert server.data.qpos[0] == 0.25
        assert "/time" in server.client().topics()


def test_a_ros_parameter_file_is_served_with_a_model(tmp_path):
    file = tmp_path / "ros.yaml"
    file.write_text(
        "/**:\n  ros__parameters:\n    mujoco_plugins:\n      beat:\n"
        "        type: mujoco_ros2_control_plugins/HeartbeatPublisherPlugin\n"
    )
    with open_server(file, model="bundled:box", run=False) as server:
        assert "/mujoco_heartbeat" in server.client().topics()


def test_plugins_are_given_by_type_by_class_or_with_parameters():
    plugins = {"beat": "heartbeat", "one": Echo, "two": {"type": Echo, "prefix": "got "}}
    with open_server("bundled:box", plugins=plugins, run=False) as server:
        client = server.client()
        echoes = {name: client.subscribe(f"/{name}/echo") for name in ("one", "two")}
        for name in echoes:
            client.publish(f"/{name}/words", String(data="you"))
            # A request after the message, on the same way.
            client.call("~/step_simulation", steps=1)
        assert [echo.next(TIMEOUT).data for echo in echoes.values()] == ["heard you", "got you"]
        assert "/mujoco_heartbeat" in client.topics()


@pytest.mark.parametrize("run", [True, False])
def test_every_call_of_a_plugin_comes_on_the_thread_that_started_it(run):
    with open_server("bundled:box", plugins={"echo": Echo}, run=run) as server:
        answer = server.client().call("/echo/thread")
        assert answer.message == ("mjplug /mjplug" if run else threading.current_thread().name)


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ({"speed": "fast"}, r"speed='fast': error: sim.speed: "),
        ({"settings": {"sim.sped": 2}}, r"settings\['sim.sped'\]=2: error: .*did you mean 'speed'"),
        ({"settings": {"sim.": 2}}, r"'sim.' is not the name of a setting"),
        ({"plugins": {"beat": "hartbeat"}}, r"plugins={'beat': 'hartbeat'}: .*did you mean 'heartbeat'"),
        ({"plugins": ["heartbeat", "heartbeat"]}, "two plugins have the same name"),
        ({"plugins": [Echo]}, "give a class a name: {NAME: CLASS}"),
        ({"plugins": {"a.b": "heartbeat"}}, "a plugin instance's name consists of"),
        ({"settings": {"sim.seed": {1}}}, r"\{1\} is a set; a configuration contains"),
        ({"model": "bundled:arm"}, "is a model, and --model bundled:arm is another one"),
        ({"keyframe": "no"}, r"keyframe='no': error: .*unknown keyframe 'no'"),
    ],
)
def test_a_wrong_argument_is_refused_with_its_name_and_value(arguments, sentence):
    with pytest.raises(ConfigError, match=sentence):
        open_server("bundled:box", **arguments)


def test_what_cannot_be_opened_raises_here_and_leaves_nothing_behind(tmp_path):
    threads = set(threading.enumerate())

    class Refusing(Plugin[Parameters]):
        def init(self, host, parameters):
            raise RequestError("not today")

    with pytest.raises(ConfigError, match="no such file"):
        open_server(tmp_path / "none.yaml")
    with pytest.raises(ModelError):
        open_server(tmp_path / "none.xml")
    for run in (True, False):
        with pytest.raises(PluginError, match="plugin grumpy refused to start: not today"):
            open_server("bundled:box", plugins={"grumpy": Refusing}, run=run)
    for arguments in ({"run": False, "duration": 1.0}, {"run": False, "paused": False}, {"duration": -1.0}):
        with pytest.raises(MjplugError, match=r"run=True|duration is -1 s"):
            open_server("bundled:box", **arguments)
    assert set(threading.enumerate()) == threads


def test_importing_mjplug_imports_neither_mujoco_nor_numpy(tmp_path):
    done = run_script(
        """
        import sys
        import mjplug
        import mjplug.client
        print({"mujoco", "numpy", "pydantic.v1", "mjplug.server"} & set(sys.modules))
        print(mjplug.open_server.__module__, "mujoco" in sys.modules)
        try:
            mjplug.open_sever
        except AttributeError as error:
            print(error)
        """,
        tmp_path,
    )
    assert done.stdout == "set()\nmjplug.server.open_server True\nmodule 'mjplug' has no attribute 'open_sever'\n"


def test_two_servers_in_one_process_warn_about_shared_names_each_in_its_own_log():
    with (
        open_server("bundled:box", settings={"node_name": "one"}) as one,
        open_server("bundled:box", connect=one.endpoint, settings={"node_name": "two"}),
        one.client() as client,
        client.subscribe("/rosout", depth=1000) as lines,
    ):
        found = {}
        while len(found) < 2:
            line = lines.next(TIMEOUT)
            if " on the same network use the same names: " in line.msg:
                found[line.name] = line.msg.partition(" on the same")[0]
    assert found == {"one": "this server and /two", "two": "this server and /one"}
