"""Runs a server and a client in two network namespaces that a virtual cable (veth) connects.

Needs Linux, `ip` (iproute2) and root. Without them it prints what is missing, and the exit code is 0.
"""

import os
import shutil
import subprocess
import sys
from pathlib import Path

here = Path(__file__).parent
sys.path.append(str(here.parent))

from server import serving  # noqa: E402 - it is in the parent folder

SIMULATOR, LAPTOP = f"simulator-{os.getpid()}", f"laptop-{os.getpid()}"
"""Names of the namespaces; the process id makes them unique, so several runs may go on at once."""


def main() -> int:
    """Returns the exit code of the part that failed, or 0."""
    if sys.platform != "linux" or os.geteuid() != 0 or shutil.which("ip") is None:
        print("left out: network namespaces need Linux, root and `ip` (Debian: apt-get install iproute2)")
        return 0
    if (tried := ip("netns", "add", SIMULATOR, check=False)).returncode != 0:
        print(f"left out: network namespaces cannot be created on this machine: {tried.stderr.strip()}")
        return 0
    try:
        connected()
        with serving(start()) as endpoint:
            print(f"laptop$ python examples/08_remote_machine/look.py {endpoint}", flush=True)
            return inside(LAPTOP, str(here / "look.py"), endpoint).wait()
    finally:
        # Deleting the namespaces also deletes the cable.
        for namespace in (SIMULATOR, LAPTOP):
            ip("netns", "del", namespace, check=False)


def ip(*words: str, check: bool = True) -> "subprocess.CompletedProcess[str]":
    """Runs `ip` with these arguments."""
    return subprocess.run(["ip", *words], capture_output=True, text=True, check=check)


def connected() -> None:
    """Adds the second namespace and connects both; their addresses are 10.99.0.1 and 10.99.0.2."""
    ip("netns", "add", LAPTOP)
    ip("link", "add", "eth0", "netns", SIMULATOR, "type", "veth", "peer", "name", "eth0", "netns", LAPTOP)
    for namespace, address in ((SIMULATOR, "10.99.0.1/24"), (LAPTOP, "10.99.0.2/24")):
        ip("-n", namespace, "address", "add", address, "dev", "eth0")
        for link in ("lo", "eth0"):
            ip("-n", namespace, "link", "set", link, "up")


def inside(namespace: str, *words: str) -> "subprocess.Popen[str]":
    """Starts Python in a namespace; the standard output of the server is a pipe, that of the client is not."""
    pipe = subprocess.PIPE if namespace == SIMULATOR else None
    return subprocess.Popen(["ip", "netns", "exec", namespace, sys.executable, *words], stdout=pipe, text=True)


def start() -> "subprocess.Popen[str]":
    """Starts the server in the namespace of the simulator."""
    print("simulator$ mjplug serve examples/08_remote_machine/config.yaml", flush=True)
    return inside(SIMULATOR, "-m", "mjplug", "serve", str(here / "config.yaml"))


if __name__ == "__main__":
    sys.exit(main())
