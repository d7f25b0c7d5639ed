"""Files of saved states: what is no saved state is refused with a reason, and nothing changes."""

import io
import json
import os
import random
import time
import zipfile
from types import SimpleNamespace

import numpy as np
import pytest
from joint_robots import compiled
from state_worlds import StateWorld, scene

from mjplug.physics import physics_state
from mjplug.services.states.state_files import decode, encode
from mjplug_schemas.mjplug_msgs import ListStates, RestoreState, SaveState


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    """A world, its folder, and the content of the file of a state."""
    folder = tmp_path_factory.mktemp("states")
    world = StateWorld(folder)
    world.prepare(60)
    world.save(file=True)
    world.content = (folder / "s.npz").read_bytes()
    world.folder = folder
    world.step(5)
    yield world
    world.close()


def restore(world, content):
    """Restores a file with some content; returns the answer, and checks that a refusal changes nothing."""
    (world.folder / "x.npz").write_bytes(content)
    before = world.digest(), world.simulation.epoch, len(world.wrench._active)
    call = world.request("restore_state", RestoreState, name="x", file=True)
    if call.refusal is not None:
        assert (world.digest(), world.simulation.epoch, len(world.wrench._active)) == before
    return call


def changed(content, header=None, **members):
    """The content with another header, or with other members; None removes one."""
    given = zipfile.ZipFile(io.BytesIO(content))
    found = {name: given.read(name) for name in given.namelist()}
    if header is not None:
        values = json.loads(found["header.json"])
        header(values)
        found["header.json"] = json.dumps(values).encode()
    for name, member in members.items():
        found[name.replace("__", "/").replace("_npy", ".npy")] = member
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, member in found.items():
            if member is not None:
                archive.writestr(name, member)
    return buffer.getvalue()


def array(values, **options):
    buffer = io.BytesIO()
    np.save(buffer, values, **options)
    return buffer.getvalue()


def test_names_in_a_file_that_cannot_be_sent_are_escaped(saved):
    def change(header):
        header["parts"]["a\0b\n\u202e"] = {**header["parts"]["heartbeat"], "left_out": "\0"}

    answer = restore(saved, changed(saved.content, change)).response
    assert r"a\x00b\n\u202e: there is no such plugin instance now" in answer.message
    assert answer.snapshot.left_out == (r"a\x00b\n\u202e",)
    listed = saved.response(saved.request("list_states", ListStates))
    assert {one.name: one.left_out for one in listed.snapshots}["x"] == (r"a\x00b\n\u202e",)
    for name in ("model", "digest", "mjplug", "mujoco"):
        refused = restore(saved, changed(saved.content, lambda header, name=name: header.update({name: "a\0"}))).refusal
        assert f"its header is invalid: {name}: " in refused
    restore(saved, saved.content)


def test_numpy_reads_the_arrays(saved):
    with np.load(saved.folder / "s.npz", allow_pickle=False) as found:
        assert np.isfinite(found["vector"]).all()
        assert found["plugins/wrench/real"].shape == (2, 11)


def test_a_file_is_written_again_without_a_difference(saved, monkeypatch):
    # Also at another time.
    monkeypatch.setattr(time, "localtime", lambda seconds=None: time.gmtime(1e9))
    assert encode(decode(saved.content)) == saved.content
    assert decode(changed(saved.content)).header == decode(saved.content).header


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda h: h.update(format=2), "format: Input should be 1"),
        (lambda h: h.update(step=-1), "step: Input should be greater than or equal to 0"),
        (lambda h: h.update(step="1"), "step: Input should be a valid integer"),
        (lambda h: h.update(step=1 << 62), "the last possible one is"),
        (lambda h: h.update(time_origin=61), "its step is 60, before the one at which its time is zero"),
        (lambda h: h.update(time_ns=1 << 62), "time_ns: Input should be less than or equal to"),
        (lambda h: h.update(lineage=1 << 64), "lineage: Input should be less than"),
        (lambda h: h.update(model="other"), "it was saved with another model"),
        (lambda h: h.update(mujoco="1.0"), "it was saved with MuJoCo 1.0; this server uses"),
        (lambda h: h.update(digest="0"), "its digest is not that of its state vector"),
        (lambda h: h.update(more=1), "more: Extra inputs are not permitted"),
        (lambda h: h.pop("parts"), "parts: Field required"),
        (
            lambda h: h["parts"]["~"]["timers"].update({"0": {"period": [1, 0], "started": 1, "due_now": True}}),
            "started",
        ),
        (lambda h: h.update(steps_since_reset=99), "steps_since_reset"),
        (lambda h: h.update(holds=[["drive"]]), "holds"),
    ],
)
def test_an_invalid_header_is_refused(saved, change, reason):
    assert reason in restore(saved, changed(saved.content, change)).refusal


@pytest.mark.parametrize(
    ("members", "reason"),
    [
        ({"vector_npy": None}, "the saved state contains no state vector"),
        ({"vector_npy": array(np.zeros(3))}, "its vector must have"),
        ({"vector_npy": array(np.zeros(3, np.float32))}, "its vector must have"),
        ({"asleep_npy": array(np.zeros(3, np.int32))}, "tree_asleep has another size"),
        ({"results__qacc_npy": None}, "the results of its last step have other sizes"),
        ({"results__other_npy": array(np.zeros(3))}, "the results of its last step have other sizes"),
        ({"vector_npy": array(np.array([object()]), allow_pickle=True)}, "which is not allowed"),
        ({"vector_npy": b"\x93NUMPY"}, "it is not a saved state"),
        ({"vector_npy": b""}, "it is not a saved state"),
        ({"header.json": b"[]"}, "its header is invalid"),
        ({"header.json": b"{"}, "its header is invalid"),
        ({"header.json": b"[" * 100_000}, "its header is invalid"),
        ({"header.json": None}, "it contains no header.json"),
    ],
)
def test_invalid_members_are_refused(saved, members, reason):
    assert reason in restore(saved, changed(saved.content, **members)).refusal


def with_vector(content, change):
    """The content with another state vector, and its digest."""
    with np.load(io.BytesIO(content)) as found:
        vector = found["vector"].copy()
    change(vector)
    digest = physics_state.digest(vector)
    return changed(content, lambda header: header.update(digest=digest), vector_npy=array(vector))


def test_indices_in_the_state_are_checked_before_mujoco_uses_them(saved):
    begin = 1 + saved.model.nq + saved.model.nv + saved.model.na
    assert saved.model.nhistory
    for cursor in (-1.0, 9.0, 1e300, 0.5, np.nan):
        content = with_vector(saved.content, lambda v, cursor=cursor: v.__setitem__(begin + 1, cursor))
        assert "the buffer of a delayed actuator is invalid" in restore(saved, content).refusal
    content = with_vector(saved.content, lambda v: v.__setitem__(begin + 1, 3.0))
    assert restore(saved, content).refusal is None
    content = with_vector(saved.content, lambda v: v.__setitem__(0, np.inf))
    assert "its time is not finite" in restore(saved, content).refusal


@pytest.mark.parametrize("asleep", [[1, 1, 1, 1, 1, 1], [9, 0, 0, 0, 0, 0], [-5000] * 6, [0, 2, 1, 3, 5, 4][::-1][:6]])
def test_chains_of_sleeping_bodies_are_checked(tmp_path, asleep):
    world = StateWorld(tmp_path, model=compiled(scene(sleep=True)), plugins=False)
    world.folder, world.wrench = tmp_path, SimpleNamespace(_active=())
    world.save(file=True)
    content = changed((tmp_path / "s.npz").read_bytes(), asleep_npy=array(np.array(asleep, np.int32)))
    call = restore(world, content)
    if sorted(asleep) == list(range(6)):
        assert call.refusal is None
        world.step(100)
    else:
        assert "tree_asleep is invalid" in call.refusal
    world.close()


def test_sensors_of_the_step_before_time_zero_have_the_time_zero(saved):
    def change(header):
        header.update(step=0, time_ns=0, sensors_current=False)

    assert restore(saved, changed(saved.content, change)).refusal is None
    reading = saved.transport.publishers["/sensors/arm/imu"]
    reading.messages.clear()
    saved.step(40)
    assert saved.loop.failure is None
    assert reading.messages
    host = saved.drive._host
    saved.restore("x", file=True)
    assert (host.time_ns, host.sensor_time_ns) == (0, 0)
    saved.restore(file=True)


@pytest.mark.parametrize("value", [np.nan, np.inf, -1e10, 1e300])
def test_a_diverged_state_is_refused(saved, value):
    for index in (1, saved.model.nq, saved.model.nq + saved.model.nv):
        content = with_vector(saved.content, lambda v, index=index: v.__setitem__(index, value))
        assert "a position or velocity is NaN, infinite or above 1e10" in restore(saved, content).refusal


def test_a_state_that_diverges_in_the_next_step_is_a_divergence_like_any_other(saved):
    content = with_vector(saved.content, lambda v: v.__setitem__(1 + saved.model.nq, 9e9))
    before = saved.loop.recovery.count
    assert restore(saved, content).refusal is None
    saved.data.qfrc_applied[:] = 1e300
    saved.step(5)
    assert saved.loop.recovery.count > before
    saved.restore(file=True)
    saved.step(5)
    assert saved.loop.failure is None


@pytest.mark.parametrize(
    ("column", "value"), [(0, 1), (0, -(1 << 60)), (1, -1), (1, 1 << 60), (2, -1), (2, 1 << 40), (2, 1)]
)
def test_a_wrench_that_does_not_act_or_has_no_marker_is_left_out(saved, column, value):
    whole = np.load(io.BytesIO(zipfile.ZipFile(io.BytesIO(saved.content)).read("plugins/wrench/whole.npy")))
    # The last one: two wrenches with the marker 1.
    whole[1, column] = value
    answer = restore(saved, changed(saved.content, plugins__wrench__whole_npy=array(whole)))
    assert answer.response.snapshot.left_out == ("wrench",)
    saved.step(20)
    assert saved.loop.failure is None


def test_plugins_that_cannot_return_to_their_state_are_reset(saved, monkeypatch, caplog):
    """A refused `strict` restore sets the present state back; if a plugin fails at that, it is reset."""
    calls = []

    def fails(state):
        calls.append(state)
        raise ValueError("no")

    saved.restore(file=True)
    monkeypatch.setattr(saved.drive, "restore", fails)
    (saved.folder / "x.npz").write_bytes(saved.content)
    refused = saved.request("restore_state", RestoreState, name="x", file=True, strict=True).refusal
    assert "drive: its saved state is invalid: ValueError('no')" in refused
    assert len(calls) == 2
    assert "plugins could not set their own state back, and are reset: drive" in caplog.text
    assert saved.drive._last_step < 0
    saved.step(3)
    assert saved.loop.failure is None


def test_an_array_larger_than_its_content_takes_no_memory(saved):
    member = bytearray(array(np.zeros(4)))
    header = member.replace(b"(4,), }", b"(4000000000000,), }")
    header[8:10] = (len(header) - 10 - 32).to_bytes(2, "little")
    assert "has another size than it says" in restore(saved, changed(saved.content, vector_npy=bytes(header))).refusal


def test_compressed_members_are_refused(saved):
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("header.json", b"0" * (64 << 20))
    assert len(buffer.getvalue()) < 100_000
    assert "its members are invalid" in restore(saved, buffer.getvalue()).refusal


def test_members_of_the_same_name_and_overlapping_ones_are_refused(saved):
    buffer = io.BytesIO(saved.content)
    with zipfile.ZipFile(buffer, "a") as archive, pytest.warns(UserWarning, match="Duplicate"):
        archive.writestr("vector.npy", b"")
    assert "its members are invalid" in restore(saved, buffer.getvalue()).refusal


@pytest.mark.parametrize("share", [0, 0.01, 0.5, 0.999])
def test_a_truncated_file_is_refused(saved, share):
    assert "it is not a saved state" in restore(saved, saved.content[: int(share * len(saved.content))]).refusal


@pytest.mark.parametrize(
    "saves",
    [
        {"count": "x"},
        {"whole": np.array([[0, 1, 0, 0]])},
        {"whole": np.zeros((2, 4), np.float64)},
        {"whole": np.zeros((2, 4), np.int64)},
        {"real": np.full((2, 11), np.nan)},
        {"bodies": ["world", "world"]},
        {"bodies": ["no such body", "brick"]},
        {"bodies": [["brick"], {}]},
        {"next_markers": None},
        {"next_id": 1e400},
    ],
)
def test_an_invalid_part_of_a_plugin_is_left_out_and_the_others_are_restored(saved, saves):
    members, values = {}, {}
    for name, value in saves.items():
        if isinstance(value, np.ndarray):
            members[f"plugins__wrench__{name}_npy"] = array(value)
        else:
            values[name] = value

    def change(header):
        part = header["parts"]["wrench"]["values"]
        part["saved"] = json.dumps({**json.loads(part["saved"]), **values})

    answer = restore(saved, changed(saved.content, change, **members)).response
    if "count" in saves:
        assert answer.snapshot.left_out == ()
        return
    assert answer.snapshot.left_out == ("wrench",)
    assert len(saved.wrench._active) == 0
    saved.step(3)
    assert saved.loop.failure is None


@pytest.mark.parametrize("part", ["joints", "drive", "odometry", "heartbeat", "~"])
def test_parts_with_other_values_are_left_out(saved, part):
    values = [None, 1, "x", [], {}, {"random": {}}]
    random.seed(part)
    for value in values:

        def change(header, value=value):
            own = header["parts"][part]["values"]
            if isinstance(value, dict):
                own.clear()
                own.update(value)
            else:
                for name in own:
                    if name != "plugin":
                        own[name] = value

        answer = restore(saved, changed(saved.content, change))
        assert answer.refusal is not None or part in answer.response.snapshot.left_out
        saved.step(2)
        assert saved.loop.failure is None
    # The content itself is still fine.
    assert restore(saved, saved.content).response.snapshot.left_out == ()


def test_damaged_files_never_do_more_than_to_be_refused(saved):
    """Bytes are changed anywhere; checksums find most of it, so headers and arrays are also changed below them."""
    generator = random.Random(5)
    refused = 0
    for number in range(int(os.environ.get("MJPLUG_FUZZ_STATES", "150"))):
        content = bytearray(saved.content)
        if number % 2:
            for _ in range(generator.randint(1, 4)):
                content[generator.randrange(len(content))] = generator.randrange(256)
            content = bytes(content)
        else:
            content = changed(saved.content, **_damaged(saved.content, generator))
        call = restore(saved, content)
        refused += call.refusal is not None
        saved.step(1)
        assert saved.loop.failure is None
    assert refused > 50
    if saved.loop.paused:
        saved.restore(file=True)


def _damaged(content, generator):
    """A member with other bytes, and the right checksum."""
    archive = zipfile.ZipFile(io.BytesIO(content))
    names = [name for name in archive.namelist() if not name.startswith(("vector", "results"))]
    name = generator.choice(names)
    member = bytearray(archive.read(name))
    for _ in range(generator.randint(1, 3)):
        member[generator.randrange(len(member))] = generator.choice(b'0123456789-eE."[]{},:nulltrue\x00\xff')
    return {name.replace("/", "__"): bytes(member)}


@pytest.mark.parametrize(("limit", "reason"), [("MAX_HEADER", "its header has"), ("MAX_ARRAYS", "it has")])
def test_a_state_that_could_not_be_read_again_is_not_written(saved, monkeypatch, limit, reason):
    before = (saved.folder / "s.npz").read_bytes()
    monkeypatch.setattr(f"mjplug.services.states.state_files.{limit}", 5)
    call = saved.request("save_state", SaveState, name="s", file=True, overwrite=True)
    assert call.refusal.startswith(f"state 's' cannot be written: {reason}")
    assert (saved.folder / "s.npz").read_bytes() == before
