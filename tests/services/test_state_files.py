"""Files of saved states: what is no saved state is refused with a reason, and nothing changes."""

import io
import json
import os
import random
import shutil
import subprocess
import sys
import threading
import zipfile
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from joint_robots import compiled
from state_worlds import StateWorld, scene

from mjplug.errors import RequestError
from mjplug.physics import physics_state
from mjplug.services.states import file_thread, state_files
from mjplug.services.states.state_files import StateFiles, decode, encode
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


def test_numpy_reads_the_arrays(saved):
    with np.load(saved.folder / "s.npz", allow_pickle=False) as found:
        assert np.isfinite(found["vector"]).all()
        assert found["plugins/wrench/real"].shape == (2, 11)


def test_a_file_is_written_again_without_a_difference(saved):
    assert encode(decode(saved.content)) == saved.content
    assert decode(changed(saved.content)).header == decode(saved.content).header


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda h: h.update(format=2), "format: Input should be 1"),
        (lambda h: h.update(step=-1), "step: Input should be greater than or equal to 0"),
        (lambda h: h.update(step="1"), "step: Input should be a valid integer"),
        (lambda h: h.update(step=1 << 62), "the last possible one is"),
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


def test_a_state_of_nan_is_a_divergence_like_any_other(saved):
    content = with_vector(saved.content, lambda v: v.__setitem__(1, np.nan))
    assert restore(saved, content).refusal is None
    saved.step(5)
    assert saved.loop.recovery.count > 0
    saved.restore(file=True)
    saved.step(5)
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


def test_a_fifo_is_refused_at_once(tmp_path):
    world = StateWorld(tmp_path, plugins=False)
    os.mkfifo(tmp_path / "x.npz")
    assert "is not a file" in world.request("restore_state", RestoreState, name="x", file=True).refusal
    (tmp_path / "y.npz").mkdir()
    assert "y.npz" in world.request("restore_state", RestoreState, name="y", file=True).refusal
    assert world.response(world.request("list_states", ListStates)).snapshots == ()
    world.close()


def test_invalid_files_are_named_in_the_list(tmp_path):
    world = StateWorld(tmp_path, plugins=False)
    world.save("good", file=True)
    (tmp_path / "bad.npz").write_bytes(b"PK")
    (tmp_path / "other.txt").write_bytes(b"")
    (tmp_path / "not a name.npz").write_bytes(b"")
    answer = world.response(world.request("list_states", ListStates))
    assert [one.name for one in answer.snapshots] == ["good"]
    assert answer.message.startswith("invalid files: bad: it is not a saved state")
    world.close()


def test_a_file_that_is_larger_than_the_limit_is_not_read(tmp_path):
    files = StateFiles(tmp_path, 10, 1000)
    (tmp_path / "x.npz").write_bytes(bytes(1001))
    with pytest.raises(RequestError, match=r"has 1001 bytes; the maximum is 1000 \(snapshots.max_bytes\)"):
        files.read("x")


def test_a_folder_that_cannot_be_written_is_named(tmp_path):
    (tmp_path / "file").write_text("")
    world = StateWorld(tmp_path / "file", plugins=False)
    refused = world.request("save_state", SaveState, name="s", file=True).refusal
    assert refused.startswith(f"state 's' cannot be written to {tmp_path / 'file'}: ")
    world.close()


def test_nothing_remains_of_a_file_that_could_not_be_written(tmp_path, monkeypatch):
    world = StateWorld(tmp_path, plugins=False)
    world.save(file=True)
    before = (tmp_path / "s.npz").read_bytes()

    def fail(descriptor):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(state_files.os, "fsync", fail)
    world.step(1)
    for name in ("s", "t"):
        refused = world.request("save_state", SaveState, name=name, file=True, overwrite=True).refusal
        assert refused.endswith("No space left on device")
    assert [path.name for path in tmp_path.iterdir()] == ["s.npz"]
    assert (tmp_path / "s.npz").read_bytes() == before
    world.close()


FULL = """
import sys
sys.path[:0] = {path!r}
from pathlib import Path
from joint_robots import compiled
from state_worlds import StateWorld, scene
from mjplug_schemas.mjplug_msgs import SaveState
folder = Path({folder!r})
world = StateWorld(folder, plugins=False)
world.save(file=True)
names = iter("abcdefghijklmnopqrstuvwxyz")
while (call := world.request("save_state", SaveState, name=next(names), file=True)).refusal is None:
    pass
print(call.refusal)
present = sorted(path.name for path in folder.iterdir())
assert "s.npz" in present and not [name for name in present if name.endswith(".tmp")], present
world.step(10)
world.restore(file=True)
assert world.simulation.step == 0
world.close()
"""


@pytest.mark.skipif(
    sys.platform != "linux" or os.geteuid() != 0 or shutil.which("unshare") is None, reason="needs root and unshare"
)
def test_a_full_disk_is_reported_and_loses_no_state(tmp_path):
    folder = tmp_path / "small"
    folder.mkdir()
    code = FULL.format(path=[str(Path(__file__).parents[1])], folder=str(folder))
    command = f'mount -t tmpfs -o size=100k tmpfs {folder} && exec {sys.executable} -c "$0"'
    done = subprocess.run(
        ["unshare", "-m", "sh", "-c", command, code], capture_output=True, text=True, check=False, timeout=120
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.endswith("No space left on device\n")


def test_physics_continues_while_a_file_is_written(tmp_path, monkeypatch):
    world = StateWorld(tmp_path, plugins=False)
    released, sync = threading.Event(), os.fsync

    def slow(descriptor):
        assert released.wait(60)
        sync(descriptor)

    monkeypatch.setattr(state_files.os, "fsync", slow)
    call = world.call("/mjplug/save_state", SaveState.Request(name="s", file=True))
    world.step(200)
    assert (world.simulation.step, call.answered) == (200, False)
    released.set()
    world.finish(call)
    assert world.response(call).snapshot.step == 0
    world.close()


def test_many_requests_for_files_are_refused(tmp_path, monkeypatch):
    world = StateWorld(tmp_path, plugins=False)
    released, sync = threading.Event(), os.fsync
    monkeypatch.setattr(state_files.os, "fsync", lambda descriptor: released.wait(60) and sync(descriptor))
    calls = [
        world.call("/mjplug/save_state", SaveState.Request(name=f"s{number}", file=True))
        for number in range(file_thread.MAX_WAITING + 1)
    ]
    assert calls[-1].refusal == "16 requests for files are waiting, which is the maximum; try again later"
    released.set()
    for call in calls[:-1]:
        world.finish(call)
        assert call.refusal is None
    world.close()


def test_closing_waits_for_the_file_that_is_written(tmp_path):
    world = StateWorld(tmp_path, plugins=False)
    world.call("/mjplug/save_state", SaveState.Request(name="s", file=True))
    world.close()
    assert [path.name for path in tmp_path.iterdir()] == ["s.npz"]


def test_two_servers_do_not_replace_each_others_files(tmp_path, monkeypatch):
    one, two = StateWorld(tmp_path, plugins=False), StateWorld(tmp_path, plugins=False)
    link = os.link

    def late(source, target):
        monkeypatch.setattr(state_files.os, "link", link)
        two.save(file=True)
        link(source, target)

    monkeypatch.setattr(state_files.os, "link", late)
    refused = one.request("save_state", SaveState, name="s", file=True).refusal
    assert "already exists" in refused
    assert [path.name for path in tmp_path.iterdir()] == ["s.npz"]
    for world in (one, two):
        world.close()
