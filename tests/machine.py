"""What tests need of the machine: without it, a test is skipped with the reason; with `CI` set, it fails."""

import os
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import NoReturn

import pytest

BYTECODE = str(Path(tempfile.gettempdir(), f"mjplug-bytecode-{os.getuid()}"))
"""Compiled modules, shared by all processes of all test runs: without them, each start takes twice as long."""


CACHE = str(Path(tempfile.gettempdir(), f"mjplug-cache-{os.getuid()}"))
"""Converted robots, instead of those of the user."""


def lacking(reason: str) -> NoReturn:
    """Skips the running test, or fails it if skipping is not allowed."""
    (pytest.fail if os.environ.get("CI") else pytest.skip)(reason)


def need_program(name: str, package: str) -> None:
    """Skips the running test on a machine without a program.

    Args:
        name: The program.
        package: Debian's package that has it.
    """
    if shutil.which(name) is None:
        lacking(f"this machine has no {name} (Debian package {package})")


def has_network_namespaces() -> bool:
    """Whether this process may make network namespaces."""
    if os.geteuid() != 0 or shutil.which("ip") is None:
        return False
    probe = f"mjplug-probe-{os.getpid()}"
    if subprocess.run(["ip", "netns", "add", probe], capture_output=True, check=False).returncode != 0:
        return False
    subprocess.run(["ip", "netns", "del", probe], check=True)
    return True
