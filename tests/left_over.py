"""Finds processes that the tests have started and that outlive them."""

import os
import time
import uuid
from pathlib import Path

MARK = "PYTEST_RUN_OF_MJPLUG"
"""A variable that all programs inherit which the tests of one run, or of one process of a parallel run, start."""

GRACE = 10.0
"""How long processes may take to end on a machine with other work [s]."""


def mark():
    """Marks what will be started from now on."""
    os.environ[MARK] = uuid.uuid4().hex


def found():
    """Waits until all marked processes have ended; describes those that have not."""
    until = time.monotonic() + GRACE
    while (remaining := _marked()) and time.monotonic() < until:
        time.sleep(0.05)
    return remaining


def _marked():
    wanted = f"{MARK}={os.environ[MARK]}".encode()
    marked = []
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            variables = (folder / "environ").read_bytes().split(b"\0")
            command = (folder / "cmdline").read_bytes().replace(b"\0", b" ")
        except OSError:
            # It has ended meanwhile, or is another user's.
            continue
        if wanted in variables and int(folder.name) != os.getpid():
            test = next((one for one in variables if one.startswith(b"PYTEST_CURRENT_TEST=")), b"")
            marked.append(
                f"process {folder.name}: {command.decode(errors='replace')[:200]} {test.decode(errors='replace')}"
            )
    return marked
