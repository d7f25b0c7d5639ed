"""Files that a command makes are whole, or not there at all."""

import errno
from pathlib import Path

import pytest

from mjplug.cli.new_files import write_file, write_folder
from mjplug.errors import MjplugError


@pytest.fixture
def full(monkeypatch):
    """Lets files take four characters, and no more."""
    opened = Path.open

    def open_full(path, *arguments, **options):
        file = opened(path, *arguments, **options)
        write = file.write

        def write_a_part(text):
            write(text[:4])
            if len(text) > 4:
                raise OSError(errno.ENOSPC, "No space left on device")

        return _Full(file, write_a_part)

    monkeypatch.setattr(Path, "open", open_full)


class _Full:
    def __init__(self, file, write):
        self._file, self.write, self.flush = file, write, file.flush

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._file.close()


def test_no_part_of_a_file_is_left(tmp_path, full):
    with pytest.raises(MjplugError, match=r"cannot write .*file: No space left on device"):
        write_file(tmp_path / "file", "12345")
    assert list(tmp_path.iterdir()) == []


def test_no_part_of_a_folder_is_left_nor_of_those_above_it(tmp_path, full):
    (tmp_path / "there").mkdir()
    with pytest.raises(MjplugError, match="No space left on device"):
        write_folder(tmp_path / "there" / "a" / "b", {"first": "1234", "c/second": "12345"})
    assert [path.name for path in tmp_path.rglob("*")] == ["there"]


def test_what_was_there_before_is_not_touched(tmp_path):
    write_file(tmp_path / "file", "before")
    with pytest.raises(MjplugError, match="already exists"):
        write_file(tmp_path / "file", "after")
    with pytest.raises(MjplugError, match="already exists"):
        write_folder(tmp_path, {"file": "after"})
    assert (tmp_path / "file").read_text() == "before"


def test_a_folder_has_all_its_files(tmp_path):
    write_folder(tmp_path / "a" / "b", {"x": "1", "c/y": "2"})
    assert (tmp_path / "a/b/x").read_text() + (tmp_path / "a/b/c/y").read_text() == "12"
