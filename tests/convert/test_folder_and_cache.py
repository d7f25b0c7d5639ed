"""The files of a conversion: written completely or not at all, kept, and made again when something changes."""

import errno
import json
import os
import signal
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from model_files import tetrahedron

from convert.robots import ARM, BOX, converted, joint, link, robot
from mjplug.convert import cache, folder
from mjplug.convert.load import converted_robot, load_model
from mjplug.convert.options import ConversionOptions
from mjplug.errors import ModelError


def contents(path):
    return {file.relative_to(path).as_posix(): file.read_bytes() for file in path.rglob("*") if file.is_file()}


def test_a_folder_has_the_files_of_the_conversion(tmp_path):
    conversion, _ = converted(tmp_path, ARM)
    folder.write_folder(tmp_path / "a" / "arm", conversion.files, force=False)
    assert contents(tmp_path / "a" / "arm") == conversion.files
    assert os.listdir(tmp_path / "a") == ["arm"]
    assert load_model(str(tmp_path / "a" / "arm" / "scene.xml")).name == "arm"
    assert load_model(str(tmp_path / "a" / "arm" / "robot.xml")).name == "arm"


def test_an_existing_folder_is_replaced_only_by_force_and_never_with_edited_files(tmp_path):
    first, _ = converted(tmp_path, ARM)
    second, _ = converted(tmp_path, ARM, gravcomp="off")
    target = tmp_path / "arm"
    folder.write_folder(target, first.files, force=False)
    with pytest.raises(ModelError, match="already exists; choose another folder, or replace it with --force"):
        folder.write_folder(target, second.files, force=False)
    folder.write_folder(target, second.files, force=True)
    assert contents(target) == second.files
    (target / "scene.xml").write_text("<mujoco/>")
    with pytest.raises(ModelError, match=r"edited since its conversion: scene\.xml"):
        folder.write_folder(target, first.files, force=True)
    (target / "scene.xml").write_bytes(second.files["scene.xml"])
    (target / "notes.txt").write_text("mine")
    with pytest.raises(ModelError, match=r"not written by a conversion: notes\.txt"):
        folder.write_folder(target, first.files, force=True)


def test_the_current_folder_is_not_replaced(tmp_path, monkeypatch):
    current = tmp_path / "a" / "b"
    current.mkdir(parents=True)
    monkeypatch.chdir(current)
    for where in (Path(), current, Path("..")):
        with pytest.raises(ModelError, match="is the current folder or contains it"):
            folder.write_folder(where, {"a": b""}, force=True)
    assert contents(tmp_path) == {}
    assert [path.name for path in tmp_path.iterdir()] == ["a"]


def test_a_link_to_a_folder_stays_a_link(tmp_path):
    (tmp_path / "real").mkdir()
    (tmp_path / "link").symlink_to("real")
    folder.write_folder(tmp_path / "link", {"a": b"1"}, force=False)
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "real" / "a").read_bytes() == b"1"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["link", "real"]


def test_a_folder_that_cannot_be_moved_leaves_nothing_beside_it(tmp_path, monkeypatch):
    (tmp_path / "robot").mkdir()

    def refuse(first, second):
        raise OSError(errno.EBUSY, "Device or resource busy")

    monkeypatch.setattr("mjplug.convert.folder.exchange", lambda first, second: False)
    monkeypatch.setattr("mjplug.convert.folder.os.rename", refuse)
    with pytest.raises(ModelError, match="cannot be written: Device or resource busy"):
        folder.write_folder(tmp_path / "robot", {"a": b""}, force=True)
    assert [path.name for path in tmp_path.iterdir()] == ["robot"]


def test_a_folder_of_something_else_is_not_replaced(tmp_path):
    (tmp_path / "thesis").mkdir()
    (tmp_path / "thesis" / "thesis.tex").write_text("years of work")
    conversion, _ = converted(tmp_path, ARM)
    with pytest.raises(ModelError, match=r"not written by a conversion: thesis\.tex"):
        folder.write_folder(tmp_path / "thesis", conversion.files, force=True)
    with pytest.raises(ModelError, match="is not a folder"):
        folder.write_folder(tmp_path / "robot.urdf", conversion.files, force=True)


def test_a_conversion_that_is_interrupted_leaves_nothing(tmp_path, monkeypatch):
    conversion, _ = converted(tmp_path, ARM)
    target = tmp_path / "out"
    target.mkdir()

    def interrupted(new, old):
        raise KeyboardInterrupt

    monkeypatch.setattr(folder, "_swap", interrupted)
    with pytest.raises(KeyboardInterrupt):
        folder.write_folder(target / "arm", conversion.files, force=False)
    assert os.listdir(target) == []


KILLED = """
import os, pathlib, signal, sys
from mjplug.convert import beside, folder
from mjplug.convert.conversion import convert
from mjplug.convert.options import ConversionOptions
from mjplug.convert.source import read_source
from mjplug.model.packages import Packages
file, target, count, scene = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2]), int(sys.argv[3]), sys.argv[4]
packages = Packages({})
files = convert(read_source(file, {}, packages), ConversionOptions(scene=scene), packages).files
left = [count]
def tick():
    left[0] -= 1
    if not left[0]:
        os.kill(os.getpid(), signal.SIGKILL)
write, swap, exchange = pathlib.Path.write_bytes, folder._swap, folder.exchange
pathlib.Path.write_bytes = lambda path, content: (write(path, content[:9]), tick(), write(path, content), tick())
folder._swap = lambda new, old: (tick(), swap(new, old))
folder.exchange = lambda new, old: (exchange(new, old), tick())[0]
folder.write_folder(target, files, force=True)
"""
"""Kills itself at a call: 1 to 10 after the half or the whole of one of five files is written, 11 before the folder
is moved into place, 12 after the folders are exchanged."""


@pytest.mark.skipif(os.name == "nt", reason="Windows has no SIGKILL")
@pytest.mark.parametrize(("replaced", "count"), [(False, 4), (True, 1), (True, 11), (True, 12)])
def test_a_conversion_that_is_killed_leaves_the_old_or_the_new_folder(tmp_path, count, replaced):
    old, _ = converted(tmp_path, ARM)
    new, _ = converted(tmp_path, ARM, scene="tabletop")
    target = tmp_path / "out" / "arm"
    if replaced:
        folder.write_folder(target, old.files, force=False)
    command = [sys.executable, "-c", KILLED, str(tmp_path / "robot.urdf"), str(target), str(count), "tabletop"]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=120)
    assert done.returncode == -signal.SIGKILL, done.stderr
    if target.exists():
        assert contents(target) in ([old.files, new.files] if replaced else [new.files])
    else:
        assert not replaced
    folder.write_folder(target, new.files, force=True)
    assert contents(target) == new.files
    assert os.listdir(tmp_path / "out") == ["arm"], "what the killed conversion left is removed"


def arm_with_mesh(path, size=1):
    tetrahedron(path / "part.stl", size)
    mesh = '<mesh filename="part.stl"/>'
    (path / "arm.urdf").write_text(
        robot(link("base", shape=BOX), link("a", visual=mesh), joint("j", "base", "a"), name="arm")
    )


def test_the_cache_keeps_a_robot_until_something_changes(tmp_path):
    arm_with_mesh(tmp_path)
    environ = {"XDG_CACHE_HOME": str(tmp_path / "cache")}
    runs = []

    def folder_of(**options):
        def progress(stage, part):
            runs.extend([stage] * (stage == "done"))

        chosen = ConversionOptions(**options)
        return converted_robot(str(tmp_path / "arm.urdf"), options=chosen, environ=environ, progress=progress).folder

    first = folder_of()
    assert first == folder_of()
    assert len(runs) == 1
    assert first.parent == tmp_path / "cache" / "mjplug" / "models"
    tetrahedron(tmp_path / "part.stl", 2)
    second = folder_of()
    third = folder_of(gravcomp="off")
    assert len({first, second, third}) == len(runs) == 3
    (second / "robot.xml").unlink()
    assert folder_of() == second
    assert len(runs) == 4
    (tmp_path / "part.stl").unlink()
    assert folder_of() not in (first, second)


def test_a_robot_is_converted_again_if_a_file_of_its_scene_changes(tmp_path):
    tetrahedron(tmp_path / "meshes" / "rock.stl", 0.3)
    scene = '<mujoco><compiler meshdir="meshes"/><asset><mesh name="r" file="rock.stl"/></asset></mujoco>'
    (tmp_path / "mine.xml").write_text(scene)
    (tmp_path / "arm.urdf").write_text(ARM)
    options = ConversionOptions(scene=str(tmp_path / "mine.xml"))

    def folder_of():
        environ = {"XDG_CACHE_HOME": str(tmp_path / "cache")}
        return converted_robot(str(tmp_path / "arm.urdf"), options=options, environ=environ).folder

    first = folder_of()
    assert folder_of() == first
    tetrahedron(tmp_path / "meshes" / "rock.stl", 0.6)
    second = folder_of()
    assert second != first
    assert (second / "assets" / "rock.stl").read_bytes() == (tmp_path / "meshes" / "rock.stl").read_bytes()


def test_a_robot_is_converted_again_if_a_texture_in_another_folder_changes(tmp_path):
    image = pytest.importorskip("PIL.Image")
    for name in ("meshes", "textures"):
        (tmp_path / name).mkdir()
    picture = tmp_path / "textures" / "paint.png"
    (tmp_path / "meshes" / "part.mtl").write_text("newmtl m\nmap_Kd ../textures/paint.png\n")
    corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvt 0 0\nvt 1 0\nvt 0 1\nvt 1 1\n"
    faces = "f 1/1 3/3 2/2\nf 1/1 2/2 4/4\nf 2/2 3/3 4/4\nf 1/1 4/4 3/3\n"
    (tmp_path / "meshes" / "part.obj").write_text(f"mtllib part.mtl\n{corners}usemtl m\n{faces}")
    mesh = link("base", visual='<mesh filename="meshes/part.obj"/>', shape=BOX)
    (tmp_path / "arm.urdf").write_text(robot(mesh))

    def pixel():
        environ = {"XDG_CACHE_HOME": str(tmp_path / "cache")}
        converted_folder = converted_robot(str(tmp_path / "arm.urdf"), environ=environ).folder
        return image.open(converted_folder / "assets" / "part.png").getpixel((0, 0))

    for color, size in (((200, 0, 0), 8), ((0, 200, 0), 16)):
        image.new("RGB", (size, size), color).save(picture)
        assert pixel() == color


def test_several_servers_convert_the_same_robot_at_once(tmp_path):
    arm_with_mesh(tmp_path)
    environ = {"XDG_CACHE_HOME": str(tmp_path / "cache")}
    with ThreadPoolExecutor(4) as threads:
        found = list(
            threads.map(lambda _: converted_robot(str(tmp_path / "arm.urdf"), environ=environ).folder, range(4))
        )
    assert len(set(found)) == 1
    assert cache.is_complete(found[0])
    assert [path.name for path in found[0].parent.iterdir()] == [found[0].name]


def test_a_cache_that_cannot_be_written_is_named(tmp_path):
    arm_with_mesh(tmp_path)
    (tmp_path / "cache").write_text("")
    with pytest.raises(ModelError, match=r"the cache .*/cache/mjplug/models cannot be written: Not a directory"):
        converted_robot(str(tmp_path / "arm.urdf"), environ={"XDG_CACHE_HOME": str(tmp_path / "cache")})


def test_mujoco_reads_a_urdf_itself_on_request_or_if_the_urdf_says_so(tmp_path):
    arm_with_mesh(tmp_path)
    environ = {"XDG_CACHE_HOME": str(tmp_path / "cache")}
    assert load_model(str(tmp_path / "arm.urdf"), options=ConversionOptions(raw=True), environ=environ).model.nu == 0
    loaded = load_model(str(tmp_path / "arm.urdf"), environ=environ)
    assert (loaded.model.nu, loaded.keyframe, loaded.name) == (1, "home", "arm")
    assert (loaded.path, loaded.described_by.name) == (tmp_path / "arm.urdf", "robot.urdf")
    text = (tmp_path / "arm.urdf").read_text()
    (tmp_path / "own.urdf").write_text(text.replace("<link", "<mujoco/><link", 1))
    assert load_model(str(tmp_path / "own.urdf"), environ=environ).model.nu == 0


@pytest.mark.parametrize(
    ("name", "options", "unused"),
    [
        ("own.urdf", {"scene": "tabletop", "base": "free"}, "base, scene (MuJoCo reads it itself, because"),
        ("own.urdf", {"raw": True, "strict": True}, "strict"),
        ("model.xml", {"scene": "floor", "fuse": True}, "fuse"),
        ("model.xml", {"scene": "floor"}, ""),
        ("arm.urdf", {"scene": "tabletop", "base": "free"}, ""),
    ],
)
def test_options_without_effect_are_reported(tmp_path, caplog, name, options, unused):
    arm_with_mesh(tmp_path)
    (tmp_path / "own.urdf").write_text((tmp_path / "arm.urdf").read_text().replace("<link", "<mujoco/><link", 1))
    (tmp_path / "model.xml").write_text("<mujoco><worldbody><body><geom size='0.1'/></body></worldbody></mujoco>")
    environ = {"XDG_CACHE_HOME": str(tmp_path / "cache")}
    load_model(str(tmp_path / name), options=ConversionOptions(**options), environ=environ)
    reported = [record.getMessage() for record in caplog.records if "have no effect" in record.getMessage()]
    assert len(reported) == bool(unused)
    assert all(f"these model_options have no effect: {unused}" in line for line in reported)


def test_the_record_contains_every_decision(tmp_path):
    conversion, model = converted(tmp_path, ARM)
    record = json.loads(conversion.files["conversion.json"])
    shoulder = record["joints"]["shoulder"]
    assert shoulder["actuator"] == "position"
    assert shoulder["velocity"] == 3.0
    assert shoulder["kp"] == model.actuator("shoulder").gainprm[0]
    assert record["base"] == "fixed"
    assert set(record["files"]) == set(conversion.files) - {"conversion.json"}
    assert {note["kind"] for note in record["notes"]} == {"guess"}
