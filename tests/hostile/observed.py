"""What a process holds: memory, file descriptors, threads, children, and shared memory of the machine."""

import os
from pathlib import Path

SHARED_MEMORY = Path("/dev/shm")


def resident(pid="self"):
    """Returns the resident memory of a process [bytes]."""
    return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def file_descriptors(pid="self"):
    """Returns the number of open file descriptors of a process."""
    return len(os.listdir(f"/proc/{pid}/fd"))


POOL = 50
"""Threads that Zenoh's runtime `net` keeps at most for short tasks; it ends those that are idle for 10 s."""


def threads(pid="self"):
    """Returns the number of threads of a process, without the pool of Zenoh, whose size follows the load."""
    pool = others = 0
    for task in Path(f"/proc/{pid}/task").iterdir():
        try:
            in_pool = (task / "comm").read_text().startswith("net-")
        except OSError:
            # It has ended meanwhile.
            continue
        pool, others = pool + in_pool, others + (not in_pool)
    return others + max(0, pool - POOL)


def children(pid):
    """Returns the ids of a process's children, and of theirs."""
    found = []
    for task in Path(f"/proc/{pid}/task").glob("*/children"):
        for child in map(int, task.read_text().split()):
            found += [child, *children(child)]
    return found


def is_running(pid):
    """Tells whether a process is there and no zombie."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    except (FileNotFoundError, ProcessLookupError):
        return False


def shared_memory_of(pids):
    """Returns the files in /dev/shm that some processes have mapped."""
    found = set()
    for pid in pids:
        try:
            maps = Path(f"/proc/{pid}/maps").read_text()
        except (FileNotFoundError, ProcessLookupError, PermissionError):
            continue
        found |= {line.split(None, 5)[5] for line in maps.splitlines() if f" {SHARED_MEMORY}/" in line}
    return found
