"""`mjplug.testing.World`: plugins in a simulation that a test steps."""

import mujoco
import numpy as np
import pytest
from conftest import ARM

from mjplug.errors import ModelError, UnknownName
from mjplug.plugin import Job, Parameters, Plugin, PluginError, RequestError, UnavailableError, Work
from mjplug.testing import FakeTransport, World
from mjplug_schemas.std_msgs import Float64, String
from mjplug_schemas.std_srvs import Trigger


class LampParameters(Parameters):
    rate: float = 50.0


class Lamp(Plugin[LampParameters]):
    """Publishes the time, repeats words, and answers at once or two steps later."""

    def init(self, host, parameters):
        self.host = host
        self.times = host.create_publisher(Float64, "~/time")
        self.words = host.create_publisher(String, "~/heard")
        host.create_timer(1.0 / parameters.rate, self.publish)
        host.create_subscription(String, "/words", self.hear)
        host.create_service(Trigger, "~/now", lambda request, call: Trigger.Response(success=True, message="now"))
        host.create_service(Trigger, "~/later", self.later)
        host.create_service(Trigger, "~/never", self.refuse)

    def publish(self):
        if self.times.matched:
            self.times.publish(Float64(data=self.host.time_ns / 1e9))

    def hear(self, message):
        if message.data == "fail":
            raise RuntimeError("as told")
        self.words.publish(message)

    def later(self, request, call):
        yield self.host.step + 2
        return Trigger.Response(success=True, message=call.parameters.get("say", "later"))

    def refuse(self, request, call):
        raise RequestError("no")


@pytest.mark.parametrize(
    "model", ["bundled:arm", ARM, mujoco.MjModel.from_xml_string(ARM)], ids=["uri", "text", "model"]
)
def test_a_world_has_a_model_from_wherever_it_comes(model):
    world = World(model)
    expected = mujoco.MjData(world.model)
    world.step(3)
    mujoco.mj_step(world.model, expected, 3)
    assert world.data.qpos.tobytes() == expected.qpos.tobytes()
    assert world.time_ns == 3 * round(world.model.opt.timestep * 1e9)


def test_a_model_that_is_not_there_and_an_unknown_keyframe_are_refused():
    with pytest.raises(ModelError, match="did you mean"):
        World("bundled:arn")
    with pytest.raises(UnknownName, match="unknown keyframe 'benk', did you mean 'bent'"):
        World(ARM, keyframe="benk")


def test_what_a_plugin_publishes_is_read_in_order():
    world = World()
    lamp = world.add(Lamp, "lamp", rate=100.0)
    assert isinstance(lamp, Lamp)
    world.step(20)
    assert [message.data for message in world.published("/lamp/time")] == [0.01, 0.02, 0.03, 0.04]
    world.published("/lamp/time").clear()
    world.transport.publishers["/lamp/time"].matched = False
    world.step(20)
    assert world.published("/lamp/time") == []


def test_messages_and_requests_are_handled_without_a_step():
    world = World()
    world.add(Lamp, "lamp")
    world.publish("/words", String(data="light"))
    assert world.published("/lamp/heard") == [String(data="light")]
    assert world.call("/lamp/now").response == Trigger.Response(success=True, message="now")
    refused = world.call("/lamp/never")
    assert (refused.response, refused.refusal, refused.answers) == (None, "no", 1)
    assert world.time_ns == 0


def test_a_service_that_takes_simulated_time_answers_in_a_later_step():
    world = World()
    world.add(Lamp, "lamp")
    call, cancelled = world.call("/lamp/later", say="light"), None
    world.step()
    assert not call.answered
    world.step()
    assert call.response.message == "light"
    cancelled = world.call("/lamp/later")
    world.reset()
    assert cancelled.refusal == "cancelled: the world was reset"


def test_a_failure_of_a_plugin_is_raised_by_the_step():
    world = World()
    world.add(Lamp, "lamp")
    world.publish("/words", String(data="fail"))
    with pytest.raises(PluginError, match=r"plugin lamp failed: RuntimeError\('as told'\)"):
        world.step()


def test_wrong_names_are_answered_with_those_that_there_are():
    world = World()
    world.add(Lamp, "lamp")
    with pytest.raises(KeyError, match=r"no plugin provides /lamp/of; services: /lamp/later, /lamp/never, /lamp/now"):
        world.call("/lamp/of")
    with pytest.raises(KeyError, match=r"no plugin subscribes to /word; topics: /words"):
        world.publish("/word", String())
    with pytest.raises(KeyError, match=r"no plugin subscribes to /word; topics: none"):
        FakeTransport().send("/word", String())


class Counting(Work):
    """Fails to open if it is told to; reports the height of the first body and what it was asked for."""

    def __init__(self, reason=""):
        self.reason = reason
        self.closed = False

    def open(self, model, publishers, logger):
        if self.reason:
            raise UnavailableError(self.reason)
        return "ready to count"

    def perform(self, data, job):
        return job.time_ns, float(data.qpos[2]), sorted(job.tasks)

    def close(self):
        self.closed = True


class Delegating(Plugin[Parameters]):
    reason = ""

    def init(self, host, parameters):
        self.events = []
        self.worker = host.create_worker(
            Counting(self.reason), [],
            on_ready=self.events.append,
            on_done=lambda job, report: self.events.append((type(job), report)),
            on_lost=lambda tasks, reason: self.events.append((sorted(tasks), reason)),
        )  # fmt: skip


def test_a_worker_performs_each_job_at_once_in_the_state_of_its_submission():
    world = World()
    plugin = world.add(Delegating, "count")
    world.data.qpos[2] = 3.0
    plugin.worker.submit(["a"])
    world.data.qpos[2] = 4.0
    world.step(0)
    assert plugin.events == ["ready to count", (Job, (0, 3.0, ["a"]))]
    assert (plugin.worker.status.state, plugin.worker.status.performed) == ("running", 1)


def test_a_worker_that_is_held_keeps_the_newest_state_and_all_tasks():
    world = World()
    plugin = world.add(Delegating, "count")
    worker = world.workers.workers["count"]
    worker.hold()
    for height, tasks in ((1.0, ["a", "b"]), (2.0, ["b", "c"])):
        world.data.qpos[2] = height
        plugin.worker.submit(tasks)
    world.step(0)
    assert plugin.events == ["ready to count"]
    worker.release()
    world.step(0)
    assert plugin.events[1:] == [(Job, (0, 2.0, ["a", "b", "c"]))]
    assert plugin.worker.status.dropped == {"b": 1}
    world.workers.close()
    assert worker.work.closed


def test_a_worker_that_is_unavailable_reports_it(monkeypatch):
    monkeypatch.setattr(Delegating, "reason", "no graphics card")
    world = World()
    plugin = world.add(Delegating, "count")
    plugin.worker.submit(["a"])
    world.step(0)
    assert plugin.events == [([], "no graphics card"), (["a"], "no graphics card")]


def test_the_random_numbers_of_a_host_depend_on_seed_and_name():
    def numbers(name, seed):
        return World().host(name, seed=seed).random.random(3)

    assert np.array_equal(numbers("a", 1), numbers("a", 1))
    assert not np.array_equal(numbers("a", 1), numbers("b", 1))
    assert not np.array_equal(numbers("a", 1), numbers("a", 2))
