"""What a long conversion shows while it runs."""

import io
import logging

import pytest
from model_files import tetrahedron

from convert.robots import BOX, joint, link, robot
from mjplug.cli import convert as command
from mjplug.convert.conversion import convert
from mjplug.convert.options import ConversionOptions
from mjplug.convert.source import read_source
from mjplug.model.packages import Packages
from mjplug.server import drafts


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.fixture
def clock(monkeypatch):
    """The time in seconds, which passes only in a test."""
    now = [100.0]
    for module in (command, drafts):
        monkeypatch.setattr(module, "monotonic", lambda: now[0])
    return now


def test_a_terminal_shows_the_stage_and_the_time_that_is_left_and_is_clean_at_the_end(monkeypatch, clock):
    terminal = Terminal()
    monkeypatch.setattr("sys.stderr", terminal)
    progress = command._Progress()
    progress("meshes", 0.05)
    clock[0] += 10.0
    progress("meshes", 0.25)
    progress.clear()
    lines = terminal.getvalue().split("\r\x1b[K")
    assert lines == ["", "meshes ... 5%", "meshes ... 25%, about 30 s left", ""]


def test_without_a_terminal_nothing_is_shown(monkeypatch, clock):
    stream = io.StringIO()
    monkeypatch.setattr("sys.stderr", stream)
    progress = command._Progress()
    progress("meshes", 0.5)
    progress.clear()
    assert stream.getvalue() == ""


def test_a_server_logs_a_long_conversion_now_and_then(caplog, clock):
    caplog.set_level(logging.INFO)
    progress = drafts.log_conversion("arm.urdf")
    for seconds, part in ((1.0, 0.05), (2.0, 0.05), (3.0, 0.2), (7.0, 0.5), (7.5, 0.6), (8.0, 1.0)):
        clock[0] = 100.0 + seconds
        progress("meshes", part)
    assert caplog.messages == ["converting arm.urdf: meshes", "converting arm.urdf: meshes, about 7 s left"]


def test_the_finished_part_grows_from_stage_to_stage(tmp_path):
    tetrahedron(tmp_path / "part.stl", 1)
    mesh = '<mesh filename="part.stl"/>'
    file = tmp_path / "robot.urdf"
    file.write_text(robot(link("base", shape=BOX), link("a", shape=mesh, visual=mesh), joint("j", "base", "a")))
    seen = []
    packages = Packages({}, tmp_path)
    convert(read_source(file, {}, packages), ConversionOptions(), packages, progress=lambda *found: seen.append(found))
    parts = [part for _, part in seen]
    assert parts == sorted(parts)
    assert parts[-1] == 1.0
    assert list(dict.fromkeys(stage for stage, _ in seen)) == [
        "meshes", "compiling", "measuring", "scene", "checking", "done",
    ]  # fmt: skip


def test_paths_outside_of_the_robot_s_folder_can_be_read_but_never_written(tmp_path):
    tetrahedron(tmp_path / "secret" / "..hidden.stl", 1)
    folder = tmp_path / "robot"
    folder.mkdir()
    meshes = ["../secret/..hidden.stl", str(tmp_path / "secret" / "..hidden.stl"), "package://p/../secret/..hidden.stl"]
    parts = [link("base", shape=BOX)]
    for i, name in enumerate(meshes):
        parts += [link(f"../../l{i}", visual=f'<mesh filename="{name}" scale="1 1 {i + 1}"/>')]
        parts += [joint(f"../j{i}", "base", f"../../l{i}")]
    file = folder / "robot.urdf"
    file.write_text(robot(*parts, name="../up"))
    packages = Packages({}, folder, {"p": folder})
    files = convert(read_source(file, {}, packages), ConversionOptions(), packages).files
    assert sum(name.startswith("assets/") for name in files) == 3
    for name in files:
        assert (tmp_path / "out" / name).resolve().is_relative_to(tmp_path / "out")
    assert str(tmp_path) not in "".join(content.decode(errors="replace") for content in files.values())
