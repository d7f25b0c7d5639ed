"""The folder of saved states: how files are written, and what else may lie there."""

import os
import shutil
import subprocess
import sys
import threading
from pathlib import Path

import pytest
from state_worlds import StateWorld

from mjplug.errors import RequestError
from mjplug.services.states import file_thread, state_files
from mjplug.services.states.state_files import StateFiles
from mjplug_schemas.mjplug_msgs import ListStates, RestoreState, SaveState


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
