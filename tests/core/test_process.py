import ctypes
import os

import pytest

from mjplug.core import process


def refuse_none(name=None, **options):
    if name is None:
        raise TypeError("bad argument type for built-in operation")
    raise OSError(f"no library {name}")


@pytest.fixture
def _windows(monkeypatch):
    """What Windows lacks: a handle of the process itself, process priorities as on POSIX, and /proc."""
    monkeypatch.setattr(ctypes, "CDLL", refuse_none)
    monkeypatch.delattr(os, "getpriority")
    monkeypatch.setattr(process.sys, "platform", "win32")


@pytest.mark.usefixtures("_windows")
def test_where_the_platform_lacks_a_measure_the_server_goes_on_without_it():
    assert process.prefer_this_thread() == {"scheduler slice": False, "timer slack": False}
    assert process.clear_timer_callback() is False
