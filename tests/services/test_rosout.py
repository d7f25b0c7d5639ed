"""`/rosout`: lines of the log as messages."""

import logging
import threading
import time

import pytest

from mjplug import log_scope
from mjplug.config.settings import Settings
from mjplug.contracts.transport import QoS
from mjplug.log import INSTANCES
from mjplug.plugin import Parameters, Plugin
from mjplug.plugin.selection import Selected
from mjplug.server.offline import OfflineWorkerPool
from mjplug.server.server import Server
from mjplug.services import rosout
from mjplug_schemas.rcl_interfaces import Log


@pytest.fixture
def world(arm_world, caplog):
    caplog.set_level(logging.DEBUG)
    end = rosout.offer(arm_world.host("sim"), arm_world.loop, "/robot1/sim")
    arm_world.end = end
    yield arm_world
    end()


def lines(world):
    world.loop.step(0)
    return world.published("/rosout")


def test_a_line_is_as_ros_tools_expect_it(world):
    before = time.time_ns()
    logging.getLogger("mjplug.physics.loop").warning("it is %d %s", 5, "late")
    (line,) = lines(world)
    assert (line.level, line.name, line.msg) == (Log.WARN, "robot1.sim", "it is 5 late")
    assert before - 1_000_000 <= line.stamp.to_ns() <= time.time_ns()
    assert line.file.endswith("test_rosout.py")
    assert (line.function, line.line > 0) == ("test_a_line_is_as_ros_tools_expect_it", True)
    assert Log.from_cdr(line.to_cdr()) == line
    assert world.transport.qos["/rosout"] == QoS(1000, "reliable", "transient_local")


@pytest.mark.parametrize(
    ("logger", "name"),
    [
        (f"{INSTANCES}.camera", "robot1.sim.camera"),
        ("mjplug.wire.session", "robot1.sim"),
        ("spinner", "robot1.sim.spinner"),
        ("mjplugin", "robot1.sim.mjplugin"),
    ],
)
def test_lines_of_plugins_have_the_instance_in_their_name(world, logger, name):
    logging.getLogger(logger).info("hello")
    assert [line.name for line in lines(world)] == [name]


@pytest.mark.parametrize(
    ("level", "ros"),
    [(5, Log.DEBUG), (10, Log.DEBUG), (20, Log.INFO), (25, Log.INFO), (30, Log.WARN), (40, Log.ERROR), (99, Log.FATAL)],
)
def test_levels_are_those_of_ros(world, level, ros, caplog):
    caplog.set_level(1)
    logging.getLogger("mjplug").log(level, "x")
    assert [line.level for line in lines(world)] == [ros]


def test_an_exception_comes_with_its_traceback(world):
    try:
        1 / 0  # noqa: B018
    except ZeroDivisionError:
        logging.getLogger("mjplug").exception("it failed")
    (line,) = lines(world)
    assert line.msg.startswith("it failed\n    Traceback")
    assert line.msg.endswith("ZeroDivisionError: division by zero")


def test_control_characters_reach_ros_tools_as_escapes(world):
    logging.getLogger("mjplug").warning("from a client: %s", "a\x1b[31m\nFORGED")
    assert lines(world)[0].msg == "from a client: a\\x1b[31m\\nFORGED"


def test_what_is_no_ros_string_is_made_one(world):
    logging.getLogger("mjplug").info("a\0b \udcff")
    assert lines(world)[0].msg == "a\\x00b \\udcff"


def test_lines_of_other_threads_come_in_their_order_on_the_physics_thread(world):
    threads = {world.transport.publishers["/rosout"]: []}
    publisher = world.transport.publishers["/rosout"]
    publish = publisher.publish
    publisher.publish = lambda message: (threads[publisher].append(threading.get_ident()), publish(message))
    thread = threading.Thread(target=lambda: [logging.getLogger("mjplug").info("line %d", i) for i in range(20)])
    thread.start()
    thread.join()
    assert not publisher.messages
    assert [line.msg for line in lines(world)] == [f"line {i}" for i in range(20)]
    assert set(threads[publisher]) == {threading.get_ident()}


def test_a_flood_is_published_in_parts_and_what_is_too_much_is_counted(world):
    for i in range(1500):
        logging.getLogger("mjplug").info("%d", i)
    first = len(lines(world))
    assert first <= rosout.MAX_LINES_PER_TURN + 1
    while not world.loop.inbox.empty():
        world.loop.step(0)
    said = [line.msg for line in world.published("/rosout")]
    assert said[0] == "500 log lines were dropped because they came faster than they could be published"
    assert said[1:] == [str(i) for i in range(500, 1500)]


def test_what_publishing_logs_is_not_published_again(world):
    publisher = world.transport.publishers["/rosout"]
    publish = publisher.publish

    def chatty(message):
        logging.getLogger("mjplug.wire").warning("I am publishing")
        publish(message)

    publisher.publish = chatty
    logging.getLogger("mjplug").info("once")
    for _ in range(5):
        assert [line.msg for line in lines(world)] == ["once"]


def test_a_publisher_that_fails_ends_it_with_one_line_elsewhere(world, caplog):
    def broken(message):
        raise RuntimeError("no wire")

    world.transport.publishers["/rosout"].publish = broken
    for i in range(3):
        logging.getLogger("mjplug").info("%d", i)
    lines(world)
    logging.getLogger("mjplug").info("after")
    lines(world)
    assert [record.getMessage() for record in caplog.records if record.exc_info] == [
        "publishing to /rosout failed; no further log lines are published"
    ]


def test_a_line_that_cannot_be_made_does_not_affect_others(world, capsys):
    logging.getLogger("mjplug.odd").handlers.clear()
    record = logging.LogRecord("mjplug.odd", logging.INFO, "f", 1, "%d", ("no number",), None)
    (handler,) = [h for h in logging.getLogger().handlers if type(h).__module__ == log_scope.__name__]
    handler.handle(record)
    assert "--- Logging error ---" in capsys.readouterr().err
    logging.getLogger("mjplug").info("fine")
    assert [line.msg for line in lines(world)] == ["fine"]


class Talking(Plugin[Parameters]):
    def init(self, host, parameters):
        self.host = host
        host.logger.info("I begin")

    def cleanup(self):
        self.host.logger.info("I end")


def test_a_server_publishes_what_its_plugins_say_from_their_beginning_to_their_end(arm_model, caplog):
    from mjplug.physics.simulation import Simulation
    from mjplug.testing import FakeTransport

    caplog.set_level(logging.INFO)
    transport = FakeTransport()
    handlers = list(logging.getLogger().handlers)
    selected = [Selected("talk", Talking, Parameters())]
    server = Server(Settings(model="?"), Simulation(arm_model), transport, selected, OfflineWorkerPool())
    server.run(duration=0.01)
    logging.getLogger("mjplug").info("after the end")
    said = transport.publishers["/rosout"].messages
    assert [(line.name, line.msg) for line in said] == [("mjplug.talk", "I begin"), ("mjplug.talk", "I end")]
    assert logging.getLogger().handlers == handlers
