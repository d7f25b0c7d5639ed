"""`mjplug.open_server`: a server in this program, on its own thread or stepped by the caller."""

import gc
import subprocess
import sys
import textwrap
import threading
import weakref

import mujoco
import numpy as np
import pytest
from cli.process import environment
from conftest import ARM
from waits import TIMEOUT

from mjplug import open_server
from mjplug.client import ClientError, connect
from mjplug.config.problem import ConfigError
from mjplug.errors import MjplugError, ModelError, PluginError, RequestError
from mjplug.plugin import Parameters, Plugin
from mjplug_schemas.std_msgs import String
from mjplug_schemas.std_srvs import Trigger


class EchoParameters(Parameters):
    prefix: str = "heard "


class Echo(Plugin[EchoParameters]):
    """Publishes each received message again, and fails if the message is `fail`."""

    def init(self, host, parameters):
        self.prefix = parameters.prefix
        self.thread = threading.current_thread()
        self.publisher = host.create_publisher(String, "~/echo")
        host.create_subscription(String, "~/words", self.hear)
        host.create_service(Trigger, "~/thread", lambda request, call: self.name_thread())

    def hear(self, message):
        if message.data == "fail":
            raise RuntimeError("as told")
        self.publisher.publish(String(data=self.prefix + message.data))

    def name_thread(self):
        same = self.thread is threading.current_thread()
        return Trigger.Response(success=same, message=self.thread.name)


@pytest.fixture
def arm(tmp_path):
    path = tmp_path / "arm.xml"
    path.write_text(ARM)
    return path


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
        "plugins": {"echo": {"type": Echo.__module__ + ":Echo"}, "pulse": {"type": "heartbeat", "update_rate": 2}},
        "remap": {"/clock": "/time"},
    }
    monkeypatch.setitem(sys.modules, Echo.__module__, sys.modules[Echo.__module__])
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


def directly(model_text, steps, keyframe):
    """The same steps with MuJoCo alone."""
    model = mujoco.MjModel.from_xml_string(model_text)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key(keyframe).id)
    data.time = 0.0
    for _ in range(steps):
        mujoco.mj_step(model, data)
    return data


def assert_same_bits(data, expected):
    for name in ("qpos", "qvel", "act", "qacc_warmstart", "sensordata", "ctrl"):
        assert getattr(data, name).tobytes() == getattr(expected, name).tobytes(), name
    assert data.time == expected.time


def test_steps_of_the_caller_are_mujocos_to_the_last_bit(arm):
    with open_server(arm, keyframe="bent", run=False, plugins=["heartbeat", "joint_state_publisher"]) as server:
        assert_same_bits(server.data, directly(ARM, 0, "bent"))
        for steps, total in ((1, 1), (1, 2), (7, 9), (0, 9), (991, 1000)):
            server.step(steps)
            assert_same_bits(server.data, directly(ARM, total, "bent"))
        assert server.time_ns == 2_000_000_000
        server.client().call("~/reset_world")
        server.step(5)
        expected = directly(ARM, 5, "bent")
        for name in ("qpos", "qvel", "act", "qacc_warmstart"):
            assert getattr(server.data, name).tobytes() == getattr(expected, name).tobytes(), name


def test_steps_of_the_caller_and_of_a_request_do_the_same(arm):
    with open_server(arm, keyframe="bent", run=False) as one, open_server(arm, keyframe="bent", run=False) as other:
        clients = [server.client() for server in (one, other)]
        clocks = [client.subscribe("/clock") for client in clients]
        for steps in (1, 1, 48):
            one.step(steps)
            assert clients[1].call("~/step_simulation", steps=steps).message.startswith(f"took {steps} steps")
            assert_same_bits(one.data, other.data)
            # The time of the last step is published by either.
            assert one.time_ns == other.time_ns
            for clock in clocks:
                while clock.next(TIMEOUT).clock.to_ns() != one.time_ns:
                    pass


def test_only_the_thread_that_opened_a_stepped_server_steps_it(arm):
    errors = []

    def attempt():
        try:
            server.step()
        except MjplugError as error:
            errors.append(str(error))

    with open_server(arm, run=False) as server:
        thread = threading.Thread(target=attempt)
        thread.start()
        thread.join()
        assert errors == ["step: /mjplug belongs to the thread that opened it"]
        for steps in (-1, 2**32, 1.5):
            with pytest.raises(MjplugError, match=f"steps is {steps}; it must be an integer from 0 to 4294967295"):
                server.step(steps)
        server.step(np.int64(0))
        assert server.time_ns == 0
    with pytest.raises(MjplugError, match="the server /mjplug has been stopped"):
        server.step()
    with open_server(arm, paused=True) as server:
        for name in ("model", "data"):
            with pytest.raises(MjplugError, match=f"{name} needs run=False: the physics thread of /mjplug owns"):
                getattr(server, name)
        with pytest.raises(MjplugError, match="step needs run=False"):
            server.step()


def test_steps_are_refused_as_those_of_a_request_are(arm):
    with open_server(arm, run=False) as server:
        server.client().call("~/set_pause", paused=False)
        with pytest.raises(
            RequestError, match=r"the simulation is running; pause it first \(~/set_pause, or mjplug sim pause\)"
        ):
            server.step()
        server.client().call("~/set_pause", paused=True)
        server.step()
        server.data.qvel[0] = np.nan
        with pytest.raises(RequestError, match=r"diverged in step .* \(0 of 10 steps were taken\)"):
            server.step(10)
        assert server.running


def test_a_stepped_server_serves_others_while_it_waits(arm):
    with open_server(arm, run=False) as server:
        answers = []

        def ask():
            with connect(server.endpoint) as client:
                answers.append(client.call("~/step_simulation", steps=20).message)
                server.stop()

        thread = threading.Thread(target=ask)
        thread.start()
        assert server.wait(timeout=60.0)
        thread.join()
        assert answers == [f"took 20 steps; t = {server.time_ns / 1e9:.6f} s"]
        with pytest.raises(MjplugError, match="the server /mjplug was stopped"):
            server.step()
    with open_server(arm, run=False) as server:
        assert server.wait(timeout=0.01) is False


def test_a_server_with_a_duration_ends_by_itself_after_its_steps(arm):
    with open_server(arm, speed="max", duration=1.2345) as server:
        assert server.wait(timeout=60.0)
        assert not server.running
        assert server.time_ns == 618 * 2_000_000
    with open_server(arm, paused=True) as server:
        assert server.wait(timeout=0.01) is False


def fail(server):
    with server.client() as client:
        client.publish("/echo/words", String(data="fail"))


def test_a_failure_of_the_physics_thread_is_raised_by_wait_and_stop():
    failed = r"plugin echo failed: RuntimeError\('as told'\) \(on_plugin_error: stop\)"
    server = open_server("bundled:box", plugins={"echo": Echo})
    fail(server)
    for _ in range(2):
        with pytest.raises(PluginError, match=failed):
            server.wait(60.0)
    # It has been raised, so it is not lost.
    server.stop()

    server = open_server("bundled:box", plugins={"echo": Echo})
    fail(server)
    server._thread.join(60.0)
    with pytest.raises(PluginError, match=failed):
        server.stop()

    def fail_in_a_block(then):
        with open_server("bundled:box", plugins={"echo": Echo}) as server:
            fail(server)
            server._thread.join(60.0)
            then()

    with pytest.raises(PluginError, match=failed):
        fail_in_a_block(lambda: None)
    with pytest.raises(ZeroDivisionError) as raised:
        fail_in_a_block(lambda: 1 / 0)
    assert "the server /mjplug had failed before: PluginError" in raised.value.__notes__[0]


def test_a_failure_of_a_stepped_server_is_raised_by_the_step():
    with open_server("bundled:box", plugins={"echo": Echo}, run=False) as server:
        fail(server)
        with pytest.raises(PluginError, match="plugin echo failed"):
            # It serves while it waits for the response, and fails meanwhile.
            server.client().call("~/set_pause", paused=True)
        with pytest.raises(PluginError, match="plugin echo failed"):
            server.step()


def test_clients_that_were_closed_are_not_kept():
    with open_server("bundled:box") as server:
        client = weakref.ref(server.client())
        client().close()
        gc.collect()
        assert client() is None


def test_a_plugin_may_stop_the_server_from_the_physics_thread():
    servers = []

    class Stopping(Plugin[Parameters]):
        def init(self, host, parameters):
            host.create_service(Trigger, "~/stop", self.stop)

        def stop(self, request, call):
            servers[0].stop()
            return Trigger.Response(success=True)

    with open_server("bundled:box", plugins={"end": Stopping}) as server:
        servers.append(server)
        assert server.client().call("/end/stop").success
        assert server.wait(60.0)


def run_script(text, tmp_path, *options):
    script = tmp_path / "script.py"
    script.write_text(textwrap.dedent(text))
    return subprocess.run(
        [sys.executable, "-W", "error", *options, str(script)],
        capture_output=True, text=True, timeout=120.0, check=False, cwd=tmp_path, env=environment(),
    )  # fmt: skip


def test_a_program_that_forgets_to_stop_its_servers_still_ends(tmp_path):
    done = run_script(
        """
        from mjplug import open_server

        one = open_server("bundled:box")
        other = open_server("bundled:box", run=False)
        client = other.client()
        print(client.call("~/set_pause", paused=True).message)
        """,
        tmp_path,
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "the simulation is already paused\n", "")


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
