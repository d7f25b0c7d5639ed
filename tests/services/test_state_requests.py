"""Saved states: their names, their lists, and requests that are refused."""

import mujoco
import numpy as np
import pytest
from joint_robots import compiled
from state_worlds import StateWorld, scene

from mjplug.services.states.service import Limits
from mjplug_schemas.mjplug_msgs import (
    DeleteState,
    GetStateDigest,
    ListStates,
    RestoreState,
    SaveState,
)


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
