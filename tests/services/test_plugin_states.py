"""Saved states: what plugins save and restore."""

import math

import numpy as np
import pytest
from conftest import BOX
from joint_robots import compiled
from state_worlds import StateWorld
from wrenches import push

from mjplug.plugin import Host, Parameters, Plugin, RequestError
from mjplug.services.states.service import Limits
from mjplug.testing import World
from mjplug_plugins.external_wrench import ExternalWrench
from mjplug_plugins.heartbeat import Heartbeat
from mjplug_schemas.mjplug_msgs import (
    RestoreState,
    SaveState,
)
from mjplug_schemas.std_msgs import Float64


class Counter(Plugin[Parameters]):
    """Counts its updates, and saves the count if its class says so."""

    saved_as: object = None

    def init(self, host: Host, parameters: Parameters) -> None:
        self.host, self.count, self.restored, self.resets = host, 0, [], 0
        self.hold = host.create_velocity_hold([0])
        self.publisher = host.create_publisher(Float64, "~/count")
        host.activate()

    def update(self) -> None:
        self.count += 1

    def on_reset(self) -> None:
        self.count, self.resets = 0, self.resets + 1


class Saving(Counter):
    def save(self):
        return {"count": self.count, "table": np.array([[self.count, math.inf]]), "nested": {"a": [1, None, "é"]}}

    def restore(self, saved):
        self.restored.append(saved)
        self.count = int(saved["count"])


class Refusing(Saving):
    def restore(self, saved):
        raise RequestError("it does not want to")


class Broken(Saving):
    def restore(self, saved):
        self.count = -1
        raise KeyError("gone")


class BrokenSave(Saving):
    def save(self):
        raise OSError("no sensor")


class Unstorable(Saving):
    def save(self):
        return {"host": self.host}


class Pickled(Saving):
    def save(self):
        return {"objects": np.array([object()])}


class Stateless(Counter):
    stateless = True


def world_with(plugin_class, **parameters):
    world = StateWorld(plugins=False)
    world.plugin = world.add(plugin_class, "own", **parameters)
    world.step(10)
    return world


def test_a_plugin_gets_what_it_has_saved():
    world = world_with(Saving)
    assert world.save().snapshot.left_out == ()
    world.step(10)
    world.plugin.hold.set(0.5)
    world.plugin.host.deactivate()
    assert world.restore().snapshot.left_out == ()
    (saved,) = world.plugin.restored
    assert (saved["count"], saved["nested"]) == (10, {"a": [1, None, "é"]})
    assert saved["table"].tolist() == [[10, math.inf]]
    assert (world.plugin.hold.velocities, world.simulation.holds) == ((), [])
    # It was active when it was saved.
    world.step(5)
    assert (world.plugin.count, world.plugin.resets) == (15, 0)


def test_what_a_plugin_changes_later_does_not_change_the_state():
    world = world_with(Saving)
    world.save()
    for _ in range(2):
        world.restore()
        world.plugin.restored[-1]["table"][0, 0] = 99
        world.plugin.restored[-1]["nested"]["a"].append(1)
    assert world.plugin.restored[1]["nested"]["a"] == [1, None, "é", 1]


def test_random_numbers_of_plugins_and_velocity_holds_are_restored():
    world = world_with(Saving)
    host, hold = world.plugin.host, world.plugin.hold
    host.random.random(3)
    hold.set(0.25)
    world.save()
    expected = host.random.random(5).tolist()
    hold.release()
    world.restore()
    assert host.random.random(5).tolist() == expected
    assert hold.velocities == (0.25,)
    world.restore()
    assert world.simulation.holds == [hold]


def test_holds_are_applied_in_the_order_in_which_they_were_set():
    world = StateWorld(plugins=False)
    first, second = world.add(Stateless, "a").hold, world.add(Stateless, "b").hold
    second.set(1.0)
    first.set(2.0)
    world.save()
    first.release()
    world.restore()
    assert world.simulation.holds == [second, first]


@pytest.mark.parametrize(
    ("plugin_class", "reason"),
    [
        (Counter, "the plugin does not save its state"),
        (BrokenSave, "its method save failed: OSError('no sensor')"),
        (Unstorable, "its state cannot be stored: Object of type Host is not JSON serializable"),
        (Pickled, "it saves an array 'objects' of object; names are letters, digits and _.-"),
    ],
)
def test_a_plugin_that_saves_nothing_is_named_and_reset(plugin_class, reason):
    world = world_with(plugin_class)
    answer = world.save()
    assert answer.snapshot.left_out == ("own",)
    assert answer.message.endswith(f"; not saved: own: {reason}")
    refused = world.request("restore_state", RestoreState, name="s", strict=True)
    assert refused.refusal == f"state 's' was not restored: strict: the state is incomplete (own: {reason})"
    assert (world.plugin.resets, world.simulation.epoch) == (0, 0)
    answer = world.restore()
    assert answer.snapshot.left_out == ("own",)
    assert answer.message.endswith(f"; not restored: own: {reason}")
    assert (world.plugin.resets, world.plugin.count) == (1, 0)


@pytest.mark.parametrize(
    ("plugin_class", "reason"),
    [(Refusing, "it does not want to"), (Broken, "its saved state is invalid: KeyError('gone')")],
)
def test_a_plugin_that_refuses_is_named_and_reset(plugin_class, reason):
    world = world_with(plugin_class)
    world.save()
    answer = world.restore()
    assert answer.message.endswith(f"; not restored: own: {reason}")
    assert (world.plugin.resets, world.plugin.count) == (1, 0)


def test_a_strict_restore_that_a_plugin_refuses_changes_nothing():
    world = StateWorld()
    world.prepare()
    world.save("a")
    refusing = world.add(Refusing, "own")
    world.step(100)
    world.save("b")
    world.step(30)
    waiting = world.push(push("top", (0, 0, 1), duration=3.0))
    world.save("c")
    refusing.restored.clear()
    world.loop.parts.remove(refusing.host._part)
    expected = world.run(100)
    world.restore("c")
    world.loop.parts.append(refusing.host._part)
    before = world.digest(), world.simulation.epoch
    refused = world.request("restore_state", RestoreState, name="b", strict=True)
    assert "own: it does not want to" in refused.refusal
    assert (world.digest(), world.simulation.epoch) == before
    assert world.run(100) == expected
    assert waiting.answered


def test_a_stateless_plugin_is_complete_and_reset():
    world = world_with(Stateless)
    assert world.save().snapshot.left_out == ()
    world.restore(strict=True)
    assert world.plugin.resets == 1


def test_a_plugin_that_saves_must_also_restore():
    with pytest.raises(TypeError, match="plugin Half has the method save; add the method restore"):

        class Half(Plugin[Parameters]):
            def init(self, host, parameters):
                pass

            def save(self):
                return {}


def test_plugins_that_came_went_or_changed_are_named(tmp_path):
    one = StateWorld(tmp_path, plugins=False)
    one.add(Heartbeat, "gone")
    one.add(Heartbeat, "faster")
    one.add(Saving, "other")
    one.step(10)
    one.save(file=True)
    one.close()
    two = StateWorld(tmp_path, plugins=False)
    two.add(Heartbeat, "faster", update_rate=5.0)
    two.add(Stateless, "other")
    two.add(Heartbeat, "new")
    refused = two.request("restore_state", RestoreState, name="s", file=True, strict=True)
    assert "strict: the state is incomplete" in refused.refusal
    answer = two.restore(file=True)
    assert set(answer.snapshot.left_out) == {"gone", "faster", "other", "new"}
    for part in (
        "new: it is not in the saved state",
        "gone: there is no such plugin instance now",
        "faster: it has other timers now",
        "other: it is of type Stateless now, not Saving",
    ):
        assert part in answer.message
    two.close()


def test_a_disabled_plugin_is_left_out():
    class Fails(Stateless):
        def update(self):
            raise ValueError("now")

    world = StateWorld(plugins=False)
    plugin = Fails()
    host = world.host("own", disable_on_error=True)
    host.attach(plugin)
    plugin.init(host, Parameters())
    world.step(1)
    assert world.save().snapshot.left_out == ("own",)


def test_forces_of_an_update_that_is_not_restored_do_not_stay():
    class Pushes(Counter):
        def update(self):
            self.host.data.xfrc_applied[1, 0] += 5.0

        def on_reset(self):
            self.host.deactivate()

    world = World(compiled(BOX))
    from mjplug.services.states import service as states

    states.offer(world.host("mjplug"), world.loop, 0, "1", Limits(), None)
    world.add(Pushes, "own")
    world.step(5)
    world.call("/mjplug/save_state", SaveState.Request(name="s"))
    assert world.data.xfrc_applied[1, 0] == 5.0
    world.call("/mjplug/restore_state", RestoreState.Request(name="s"))
    assert not world.data.xfrc_applied.any()


def test_wrench_plugins_of_two_instances_keep_their_wrenches():
    world = StateWorld(plugins=False)
    one, two = world.add(ExternalWrench, "one"), world.add(ExternalWrench, "two")
    from wrenches import request

    world.call("/one/apply_wrench", request(push("top", (0, 0, 9), duration=2.0)))
    world.step(2)
    world.save()
    world.call("/two/apply_wrench", request(push("top", (0, 0, 9), duration=2.0)))
    world.restore(strict=True)
    assert (len(one._active), len(two._active)) == (1, 0)


def test_the_digest_after_a_restore_is_the_saved_one_if_only_a_wrench_acts():
    """Its plugin stops and starts again in the restore, and would leave no force."""
    world = StateWorld(plugins=False)
    world.wrench = world.add(ExternalWrench, "wrench")
    world.push(push("top", (0, 0, 9), duration=2.0))
    world.step(20)
    saved, forces = world.save().snapshot.digest, world.data.xfrc_applied.copy()
    assert forces.any()
    assert world.digest() == saved
    world.step(30)
    world.restore(strict=True)
    assert world.digest() == saved
    assert np.array_equal(world.data.xfrc_applied, forces)
