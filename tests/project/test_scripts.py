"""`make test-all` and `make release`, with stand-ins for uv and make."""

import importlib.util
import io
import os
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


def script(name):
    spec = importlib.util.spec_from_file_location(name, ROOT / ".ci" / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def programs(tmp_path, monkeypatch):
    """Puts a program that runs a shell script first on PATH."""
    monkeypatch.setenv("PATH", f"{tmp_path}{os.pathsep}{os.environ['PATH']}")
    monkeypatch.setenv("PYENV_ROOT", str(tmp_path / "pyenv"))
    monkeypatch.setattr(sys, "argv", ["test_all.py"])

    def put(name, text):
        path = tmp_path / name
        path.write_text(f"#!/bin/sh\n{text}\n")
        path.chmod(0o755)

    return put


FINDS_3_12 = """
case "$*" in
  "python find"*3.12) echo /opt/python3.12;;
  *) echo "error: Failed to install $3" >&2; echo "  cause: no network" >&2; exit 1;;
esac
"""


def test_each_python_that_is_found_is_tested_and_the_others_are_named(programs, capfd):
    programs("uv", FINDS_3_12)
    programs("make", 'echo "made $*"')
    assert script("test_all").main() == 0
    shown = capfd.readouterr().out
    assert "made test VENV=build/python-3.12 PYTHON=/opt/python3.12\n" in shown
    assert shown.count("made") == 1
    assert "Python 3.12: passed" in shown
    missing = "not run: it is not on this machine, and uv cannot download it (Failed to install 3.13)"
    assert f"Python 3.13: {missing}\n" in shown


def test_a_failure_under_one_python_is_a_failure(programs, capfd):
    programs("uv", FINDS_3_12)
    programs("make", "exit 2")
    assert script("test_all").main() == 1
    assert "Python 3.12: FAILED" in capfd.readouterr().out


def test_a_machine_without_any_python_is_a_failure(programs, capfd):
    programs("uv", "exit 1")
    assert script("test_all").main() == 1
    assert capfd.readouterr().out.count("not run") == 4


def archive_of(path, names):
    with tarfile.open(path, "w:gz") as archive:
        for name in names:
            archive.addfile(tarfile.TarInfo(f"mjplug-0/{name}"), io.BytesIO())


def test_an_sdist_without_a_test_is_refused(tmp_path):
    tests = [str(path.relative_to(ROOT)) for path in (ROOT / "tests").rglob("*.py")]
    sdist = tmp_path / "mjplug-0.tar.gz"
    archive_of(sdist, tests)
    release = script("release")
    assert release.unpack(sdist, tmp_path) == tmp_path / "mjplug-0"
    lacking = tmp_path / "other" / "mjplug-0.tar.gz"
    lacking.parent.mkdir()
    archive_of(lacking, sorted(tests)[1:])
    with pytest.raises(SystemExit, match=f"the sdist lacks .*{sorted(tests)[0]}"):
        release.unpack(lacking, lacking.parent)


def test_wheels_that_differ_in_one_file_are_refused_with_its_name(tmp_path, monkeypatch):
    release = script("release")
    (tmp_path / "direct").mkdir()
    for place, text in ((tmp_path / "a.whl", "1"), (tmp_path / "direct" / "a.whl", "2")):
        with zipfile.ZipFile(place, "w") as archive:
            archive.writestr("mjplug/same.py", "")
            archive.writestr("mjplug/other.py", text)
    monkeypatch.setattr(release, "run", lambda *command: None)
    with pytest.raises(SystemExit, match=r"these files differ: \['mjplug/other.py'\]"):
        release.compare(tmp_path / "a.whl", tmp_path)
