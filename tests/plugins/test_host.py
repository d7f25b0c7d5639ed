from functools import partial

import pytest

from mjplug.errors import PluginError, RequestError
from mjplug.plugin import Host, QoS
from mjplug_schemas.names import resolve
from mjplug_schemas.std_msgs import String
from mjplug_schemas.std_srvs import Trigger


@pytest.fixture
def host(arm_world):
    rules = partial(resolve, namespace="/lab", node="camera", remap={"/lab/camera/scan": "/scan"})
    return Host("camera", arm_world.loop, arm_world.transport, rules, arm_world.workers, arm_world.diagnostics)


@pytest.mark.parametrize(
    ("name", "full"),
    [
        ("/clock", "/clock"),
        ("image", "/lab/camera/image"),
        ("~/image", "/lab/camera/image"),
        ("a/b", "/lab/camera/a/b"),
        ("scan", "/scan"),
    ],
)
def test_names_mean_what_they_mean_in_ros_after_remapping(host, name, full):
    assert host.full_name(name) == full


def test_a_name_that_breaks_the_rules_is_refused_with_the_rule(host):
    with pytest.raises(PluginError, match="'/a//b' is not a valid ROS name: a name must not contain '//'"):
        host.create_publisher(String, "/a//b")


@pytest.mark.parametrize("period", [0, -1.0, float("nan"), float("inf")])
def test_a_timer_needs_a_positive_period(host, period):
    with pytest.raises(PluginError, match="it must be positive and finite"):
        host.create_timer(period, lambda: None)


def test_a_timer_bound_to_a_publisher_sleeps_without_subscribers(arm_world, host):
    fired = []
    publisher = host.create_publisher(String, "/words")
    fake = arm_world.transport.publishers["/words"]
    host.create_timer(0.01, lambda: fired.append(host.step), while_matched=publisher)
    arm_world.loop.step(12)
    fake.matched = False
    arm_world.loop.step(100)
    assert fired == [5, 10]
    assert arm_world.loop.scheduler.next_due > arm_world.simulation.step + 1000
    fake.matched = True
    fake.on_matched()
    arm_world.loop.step(10)
    assert fired == [5, 10, 115, 120]


def test_a_timer_bound_to_several_publishers_sleeps_if_none_has_a_subscriber(arm_world, host):
    fired = []
    publishers = [host.create_publisher(String, name) for name in ("/words", "/more")]
    words, more = (arm_world.transport.publishers[name] for name in ("/words", "/more"))
    host.create_timer(0.01, lambda: fired.append(host.step), while_matched=publishers)
    words.matched = False
    arm_world.loop.step(12)
    assert fired == [5, 10]
    more.matched = False
    arm_world.loop.step(100)
    assert fired == [5, 10]
    assert arm_world.loop.scheduler.next_due > arm_world.simulation.step + 1000
    for fake in (more, words):
        fake.matched = True
        fake.on_matched()
    arm_world.loop.step(10)
    assert fired == [5, 10, 115, 120]


def test_a_subscription_with_a_depth_delivers_the_newest_in_order(arm_world, host):
    got = []
    host.create_subscription(String, "/words", lambda m: got.append(m.data), QoS(depth=2))
    for word in "abcd":
        arm_world.transport.send("/words", String(data=word))
    arm_world.loop.step(1)
    assert got == ["c", "d"]


def test_a_message_that_the_plugin_refuses_is_logged_once_a_second_and_the_plugin_continues(arm_world, host, caplog):
    def refuse(message):
        raise RequestError(f"no joint {message.data!r}")

    host.create_subscription(String, "/words", refuse)
    for _ in range(100):
        arm_world.transport.send("/words", String(data="x"))
        arm_world.loop.step(1)
    assert arm_world.simulation.step == 100
    assert caplog.messages[0] == "topic /words: a message was refused: no joint 'x'"
    assert len(caplog.messages) < 10


def test_an_error_in_a_service_reaches_its_client_and_the_server_continues(arm_world, host, caplog):
    def fail(request, call):
        raise ValueError("broken")

    host.create_service(Trigger, "~/trigger", fail)
    call = arm_world.call("/lab/camera/trigger")
    assert call.refusal == "internal error: ValueError('broken')"
    arm_world.loop.step(3)
    assert arm_world.simulation.step == 3


def test_random_numbers_are_reproducible_and_differ_between_instances_and_seeds(arm_world):
    def draw(name, seed):
        return arm_world.host(name, seed=seed).random.random()

    assert draw("a", 1) == draw("a", 1)
    assert len({draw("a", 1), draw("b", 1), draw("a", 2)}) == 3


def test_the_time_is_that_of_the_step(arm_world, host):
    arm_world.loop.step(750)
    assert host.time_ns == 1_500_000_000
    assert (host.now().sec, host.now().nanosec) == (1, 500_000_000)
    assert host.time_of(1000) == 2.0
    assert host.steps_covering(3_000_001) == 2


def test_a_command_keeps_its_place_among_the_requests(arm_world, host):
    order = []
    host.create_subscription(String, "/command", lambda m: order.append(m.data))
    arm_world.transport.send("/command", String(data="before"))
    arm_world.loop.inbox.post(lambda: order.append("request"))
    arm_world.transport.send("/command", String(data="after"))
    arm_world.loop.step(1)
    assert order == ["request", "after"]


def test_a_plugin_that_is_switched_off_answers_what_waits(arm_world):
    host = arm_world.host("fragile", disable_on_error=True)

    def wait(request, call):
        yield 1000
        return Trigger.Response(success=True)

    def fail():
        raise ZeroDivisionError("oops")

    host.create_service(Trigger, "~/wait", wait)
    host.create_timer(0.01, fail)
    call = arm_world.call("/fragile/wait")
    arm_world.loop.step(10)
    assert call.refusal == "plugin fragile was disabled after an error: ZeroDivisionError('oops')"


def test_a_timer_cannot_be_bound_to_the_publisher_of_another(arm_world, host):
    foreign = arm_world.host("other").create_publisher(String, "~/x")
    with pytest.raises(PluginError, match="while_matched contains an object that is not a publisher of this plugin"):
        host.create_timer(1.0, lambda: None, while_matched=foreign)
    own = host.create_publisher(String, "/own")
    with pytest.raises(PluginError, match="while_matched contains an object that is not a publisher of this plugin"):
        host.create_timer(1.0, lambda: None, while_matched=[own, foreign])
