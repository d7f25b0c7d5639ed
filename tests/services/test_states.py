"""Saved states: what is published after a restore is what was published after the save, byte by byte."""

import itertools
import math
import os
import signal
import subprocess
import sys
from pathlib import Path

import mujoco
import numpy as np
import pytest
from conftest import BOX
from joint_robots import compiled
from state_worlds import StateWorld, scene
from wrenches import push

from mjplug.physics import physics_state
from mjplug.physics.reset import Reset
from mjplug.plugin import Host, Parameters, Plugin, RequestError
from mjplug.services import clock, step_simulation
from mjplug.services.states.service import Limits
from mjplug.services.stepping.ownership import Ownership
from mjplug.testing import World
from mjplug_plugins.external_wrench import ExternalWrench
from mjplug_plugins.heartbeat import Heartbeat
from mjplug_schemas.mjplug_msgs import (
    DeleteState,
    GetStateDigest,
    ListStates,
    RestoreState,
    SaveState,
)
from mjplug_schemas.mujoco_ros2_control_msgs import StepSimulation
from mjplug_schemas.std_msgs import Float64, String

SCRIPT = Path(__file__).parents[1] / "state_worlds.py"


@pytest.fixture(scope="module")
def prepared(tmp_path_factory):
    """A world with a state `s` in memory and in a file, and what follows it."""
    folder = tmp_path_factory.mktemp("states")
    world = StateWorld(folder)
    world.prepare()
    world.save()
    world.save(file=True)
    world.expected = world.run()
    world.folder = folder
    yield world
    world.close()


def test_the_state_is_in_the_middle_of_everything(prepared):
    world = StateWorld(prepared.folder)
    world.prepare()
    assert world.data.ncon > 4
    brick, top = world.wrench._active.looped
    assert 0 < brick.scale((151 - brick.start) * 0.002) < 1
    assert top.scale((151 - top.start) * 0.002) == 1
    (bank,) = world.joints._joints.banks
    assert np.abs(bank.save()["integral"]).min() > 0.1
    assert world.joints._trajectories.running
    due = [timer.due - 151 for part in world.loop.parts for timer in part.timers.values()]
    assert len(set(due)) > 4
    numbers = [count for count, _ in prepared.expected[1].values()]
    assert sum(number > 10 for number in numbers) == 8


@pytest.mark.parametrize(("file", "strict"), [(False, True), (True, False)])
def test_a_restored_state_continues_as_it_did(prepared, file, strict):
    for _ in range(2):
        answer = prepared.restore(file=file, strict=strict)
        assert (prepared.simulation.step, prepared.data.time) == (151, sum(itertools.repeat(0.002, 151)))
        assert answer.snapshot.left_out == ()
        assert prepared.run() == prepared.expected


def test_another_server_continues_from_the_file(prepared):
    world = StateWorld(prepared.folder)
    # It has a history of its own.
    world.push(push("top", (1, 0, 3), duration=3.0))
    world.step(77)
    world.restore(file=True, strict=True)
    assert world.run() == prepared.expected
    world.close()


@pytest.mark.slow
def test_another_process_continues_after_the_first_one_was_killed(tmp_path, prepared):
    first = subprocess.Popen([sys.executable, SCRIPT, "save", tmp_path, "1000"], stdout=subprocess.PIPE, text=True)
    try:
        expected = first.stdout.readline()
        os.kill(first.pid, signal.SIGKILL)
    finally:
        first.kill()
        first.wait()
        first.stdout.close()
    second = subprocess.run(
        [sys.executable, SCRIPT, "restore", tmp_path, "1000"], capture_output=True, text=True, check=True
    )
    assert second.stdout == expected == f"{prepared.expected!r}\n"


@pytest.mark.parametrize("steps", [0, 1, 2, 5, 37, 250])
def test_any_step_can_be_saved(steps):
    world = StateWorld()
    world.prepare(steps)
    world.save()
    expected = world.run(300)
    world.restore(strict=True)
    assert world.run(300) == expected


def test_bodies_that_sleep_are_restored():
    world = StateWorld(model=compiled(scene(sleep=True)), plugins=False)
    world.step(2500)
    assert (world.data.tree_asleep >= 0).any()
    assert (world.data.tree_asleep < 0).any()
    world.save()

    def wake():
        world.data.qvel[world.model.body_dofadr[world.simulation.body_id("ball")] + 2] = 3.0
        results = [world.step(400) or world.data.tree_asleep.tolist() for _ in range(5)]
        return results, world.digest()

    expected = wake()
    world.restore()
    assert wake() == expected


def test_the_results_of_the_last_step_are_restored():
    world = StateWorld(plugins=False)
    world.data.ctrl[:] = 0.3, -0.2, 0.1
    world.step(60)
    names = ("sensordata", "qacc", "actuator_force", "qfrc_constraint", "cfrc_ext", "xpos")
    before = {name: getattr(world.data, name).copy() for name in names}
    world.save()
    world.step(100)
    world.restore()
    for name, array in before.items():
        assert array.any(), name
        assert np.array_equal(getattr(world.data, name), array), name
    assert world.simulation.sensor_step == 59


def test_time_can_continue():
    world = StateWorld()
    world.prepare()
    world.save()
    world.step(500)
    position = world.data.qpos.copy()
    answer = world.restore(keep_time=True, strict=True)
    assert (world.simulation.step, world.data.time) == (651, 1.302)
    assert "t = 1.302000 s (step 651)" in answer.message
    assert not np.array_equal(world.data.qpos, position)
    # The wrench has the same rest of its ramp, and timers the same rest of their periods.
    (brick, _) = world.wrench._active.looped
    assert (brick.start, brick.end) == (500, 950)
    world.clear()
    world.step(300)
    kept = {name: count for name, (count, _) in world.told().items()}
    world.restore(strict=True)
    digest, told = world.run(300)
    assert kept == {name: count for name, (count, _) in told.items()}
    world.restore(keep_time=True)
    world.step(300)
    assert world.digest() != digest, "the digest contains the time"


def test_the_epoch_grows_and_the_clock_is_published():
    world = StateWorld(plugins=False)
    clock.offer(world.host("other"), world.loop, 100.0)
    world.step(100)
    world.save()
    world.step(900)
    world.clear()
    world.restore()
    assert world.simulation.epoch == 1
    assert [message.data for message in world.published("/other/epoch")] == [1]
    assert [message.clock.to_ns() for message in world.published("/clock")] == [200_000_000]
    world.restore()
    assert world.simulation.epoch == 2


def test_noise_is_that_of_the_saved_past_and_a_reset_draws_new_noise():
    world = StateWorld()
    world.loop.reset(Reset())
    world.prepare()
    world.save()
    first = world.run(100)[1]["/sensors/arm/imu"]
    world.restore()
    assert world.run(100)[1]["/sensors/arm/imu"] == first
    world.loop.reset(Reset())
    assert (world.simulation.epoch, world.simulation.lineage) == (3, 2)
    world.restore()
    assert (world.simulation.epoch, world.simulation.lineage) == (4, 1)
    assert world.run(100)[1]["/sensors/arm/imu"] == first


def test_waiting_requests_are_refused_and_their_wrenches_end():
    world = StateWorld()
    step_simulation.offer(world.host("mjplug"), world.loop, Ownership("mjplug/@step"))
    world.step(10)
    world.save()
    wrench = world.push(push("top", (0, 0, 9), duration=2.0))
    steps = world.call("/mjplug/step_simulation", StepSimulation.Request(steps=5000))
    world.step(3)
    world.restore(strict=True)
    assert wrench.refusal == "cancelled: a state was restored"
    assert steps.refusal.startswith("cancelled: a state was restored")
    assert len(world.wrench._active) == 0
    world.step(1)
    assert not world.data.xfrc_applied.any()


def test_the_client_of_a_wrench_only_observes_it():
    world = StateWorld()
    call = world.push(push("top", (0, 0, 9), duration=0.02))
    world.step(4)
    world.save()
    world.step(6)
    assert call.response.success
    world.restore()
    (wrench,) = world.wrench._active.looped
    assert wrench.end == 10
    world.step(5)
    assert world.data.xfrc_applied.any()
    world.step(1)
    assert not world.data.xfrc_applied.any()
    assert call.answers == 1


def test_more_wrenches_than_the_loop_takes_are_restored():
    world = StateWorld()
    for number in range(40):
        world.push(push("top", (0.1 * number, 1, 0), duration=0.1 + 0.01 * number, ramp=0.1))
    world.step(20)
    world.save()
    expected = world.run(300)
    world.restore(strict=True)
    assert world.run(300) == expected


def test_a_sleeping_timer_wakes_in_its_phase_after_a_restore():
    world = StateWorld(plugins=False)
    host, fired = world.host("timers"), []
    publisher = host.create_publisher(String, "~/text")
    publisher.matched = False
    host.create_timer(0.02, lambda: fired.append(host.step), while_matched=publisher)
    world.step(33)
    world.save()
    world.step(100)
    publisher.matched = True
    world.restore()
    world.step(30)
    assert fired == [40, 50, 60]


def test_a_timer_that_is_due_at_the_saved_step_fires_once_after_a_restore():
    world = StateWorld(plugins=False)
    host, fired = world.host("timers"), []
    host.create_timer(0.02, lambda: fired.append(host.step))
    calls = []
    # Created later, so it posts the request after the timer above has fired at step 9, and before step 10.
    timer = host.create_timer(0.002, lambda: None)
    advance = world.simulation.advance

    def advance_and_request(steps):
        found = advance(steps)
        if world.simulation.step == 10 and not calls:
            calls.append(world.transport.call("/mjplug/save_state", SaveState.Request(name="s")))
            # The loop handles the request before the timers of this boundary.
            world.loop.inbox.drain(1.0)
        return found

    world.simulation.advance = advance_and_request
    world.step(12)
    timer.cancel()
    assert calls[0].response.snapshot.step == 10
    assert fired == [10]
    world.restore()
    world.step(10)
    assert fired == [10, 10, 20]


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


def test_another_model_is_refused_with_the_reason(tmp_path):
    one = StateWorld(tmp_path, plugins=False)
    one.save(file=True)
    two = StateWorld(tmp_path, model=compiled(scene(mass=4)), plugins=False)
    refused = two.request("restore_state", RestoreState, name="s", file=True)
    assert refused.refusal == (
        "state 's' was not restored: it was saved with another model, or with another version or configuration of the "
        "model"
    )
    assert two.simulation.epoch == 0
    for world in (one, two):
        world.close()


def test_the_model_is_identified_by_its_values_not_by_its_folder(tmp_path):
    text = '<mujoco><asset><hfield name="h" file="h.png" size="1 1 1 1"/></asset><worldbody>%s</worldbody></mujoco>'
    import cv2

    digests = set()
    for folder in ("a", "much/longer/b"):
        place = tmp_path / folder
        place.mkdir(parents=True)
        cv2.imwrite(str(place / "h.png"), np.arange(100, dtype=np.uint8).reshape(10, 10))
        (place / "m.xml").write_text(text % '<geom type="hfield" hfield="h"/>')
        world = StateWorld(model=mujoco.MjModel.from_xml_path(str(place / "m.xml")), plugins=False)
        digests.add(world.save().snapshot.model_digest)
    assert len(digests) == 1


def test_another_mujoco_is_refused_with_the_reason(monkeypatch):
    world = StateWorld(plugins=False)
    world.save()
    monkeypatch.setattr(mujoco, "__version__", "9.9.9")
    refused = world.request("restore_state", RestoreState, name="s")
    assert refused.refusal.endswith("; this server uses 9.9.9")


def test_another_seed_is_refused_if_strict(tmp_path):
    one, two = StateWorld(tmp_path, plugins=False), StateWorld(tmp_path, plugins=False, seed=8)
    one.save(file=True)
    refused = two.request("restore_state", RestoreState, name="s", file=True, strict=True)
    assert refused.refusal.endswith("(sim.seed: it is 8 here, and was 7)")
    two.restore(file=True)
    for world in (one, two):
        world.close()


def test_states_are_listed_and_deleted(tmp_path):
    world = StateWorld(tmp_path, plugins=False)
    assert world.response(world.request("list_states", ListStates)).snapshots == ()
    world.step(5)
    world.save("b")
    world.save("a", file=True)
    world.step(5)
    world.save("a")
    listed = world.response(world.request("list_states", ListStates)).snapshots
    assert [(one.name, one.file, one.step) for one in listed] == [("b", False, 5), ("a", False, 10), ("a", True, 5)]
    assert all(one.size > 1000 and one.digest and one.stamp.to_ns() == one.step * 2_000_000 for one in listed)
    world.response(world.request("delete_state", DeleteState, name="a", file=True))
    world.response(world.request("delete_state", DeleteState, name="b"))
    listed = world.response(world.request("list_states", ListStates)).snapshots
    assert [(one.name, one.file) for one in listed] == [("a", False)]
    assert list(tmp_path.iterdir()) == []
    world.close()


def test_unknown_states_are_refused(tmp_path):
    world = StateWorld(tmp_path, plugins=False)
    world.save("start")
    for service, type in (("restore_state", RestoreState), ("delete_state", DeleteState)):
        refused = world.request(service, type, name="strat").refusal
        assert refused == "unknown state 'strat', did you mean 'start'?; known: start"
        refused = world.request(service, type, name="start", file=True).refusal
        assert f"there is no file start.npz in {tmp_path}; states there: none" in refused
    world.close()


@pytest.mark.parametrize(
    "name", ["", "../s", "/etc/passwd", "a/b", "a.b", "1a", "a b", "é", "a" * 65, "..", "a\n", "C:a", "~"]
)
def test_a_name_is_never_a_path(tmp_path, name):
    world = StateWorld(tmp_path, plugins=False)
    for service, type in (("save_state", SaveState), ("restore_state", RestoreState), ("delete_state", DeleteState)):
        for file in (False, True):
            refused = world.request(service, type, name=name, file=file).refusal
            assert "cannot be the name of a state; use letters, digits and underscores" in refused
    world.close()
    assert list(tmp_path.iterdir()) == []


def test_without_a_folder_there_are_no_files():
    world = StateWorld(plugins=False)
    for service, type in (("save_state", SaveState), ("restore_state", RestoreState), ("delete_state", DeleteState)):
        refused = world.request(service, type, name="s", file=True).refusal
        assert refused == "no folder for files is set; set snapshots.folder in the configuration"


def test_an_existing_state_is_replaced_on_request_only(tmp_path):
    world = StateWorld(tmp_path, plugins=False)
    for file in (False, True):
        world.save(file=file)
    world.step(3)
    for file in (False, True):
        refused = world.request("save_state", SaveState, name="s", file=file).refusal
        assert "already exists; set overwrite, or choose another name" in refused
        assert world.save(file=file, overwrite=True).snapshot.step == 3
    world.step(3)
    for file in (False, True):
        assert world.restore(file=file).snapshot.step == world.simulation.step == 3
    world.close()


@pytest.mark.parametrize("file", [False, True])
def test_states_beyond_the_limits_are_refused_and_none_is_lost(tmp_path, file):
    world = StateWorld(tmp_path, plugins=False, limits=Limits(2, 1 << 20))
    world.save("a", file=file)
    world.save("b", file=file)
    refused = world.request("save_state", SaveState, name="c", file=file).refusal
    assert "snapshots.max_states" in refused
    assert "delete" in refused
    world.save("b", overwrite=True, file=file)
    world.response(world.request("delete_state", DeleteState, name="a", file=file))
    world.save("c", file=file)
    world.close()
    world = StateWorld(tmp_path / "small", plugins=False, limits=Limits(9, 1000))
    refused = world.request("save_state", SaveState, name="c", file=file).refusal
    assert "the maximum is 1000 (snapshots.max_bytes)" in refused
    assert world.response(world.request("list_states", ListStates)).snapshots == ()
    world.close()


def test_the_digest_is_the_hash_of_the_state_vector():
    import hashlib

    world = StateWorld(plugins=False)
    world.step(20)
    answer = world.response(world.request("get_state_digest", GetStateDigest))
    vector = np.empty(mujoco.mj_stateSize(world.model, mujoco.mjtState.mjSTATE_INTEGRATION))
    mujoco.mj_getState(world.model, world.data, vector, mujoco.mjtState.mjSTATE_INTEGRATION)
    assert answer.digest == hashlib.sha256(vector.astype("<f8").tobytes()).hexdigest()
    assert (answer.step, answer.stamp.to_ns(), answer.epoch) == (20, 40_000_000, 0)
    saved = world.save().snapshot
    assert (saved.digest, saved.model_digest) == (answer.digest, answer.model_digest)
    world.step(1)
    assert world.digest() != answer.digest


def test_a_simulation_of_nothing_can_be_saved():
    world = StateWorld(model=compiled("<mujoco><worldbody><geom size='1'/></worldbody></mujoco>"), plugins=False)
    world.step(3)
    world.save()
    world.step(3)
    world.restore()
    assert (world.simulation.step, world.data.time) == (3, 0.006)


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


def test_forces_without_an_update_are_state():
    world = StateWorld(plugins=False)
    world.data.xfrc_applied[5, 2] = 2.0
    world.step(5)
    world.save()
    expected = world.run(50)
    world.restore()
    assert world.data.xfrc_applied[5, 2] == 2.0
    assert world.run(50) == expected


def test_the_results_are_those_arrays_that_do_not_move_in_memory():
    world = StateWorld(plugins=False)
    world.step(200)
    arrays = physics_state.result_arrays(world.data)
    places = {name: array.ctypes.data for name, array in arrays.items()}
    world.loop.reset(Reset())
    world.step(1)
    assert places == {name: array.ctypes.data for name, array in physics_state.result_arrays(world.data).items()}
    assert {"sensordata", "qacc", "xpos", "qfrc_actuator"} <= places.keys()
    assert not any(name.startswith(("efc_", "qpos", "qvel", "contact")) for name in places)


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
