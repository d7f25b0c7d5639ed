"""Puts a server and a client on two machines that are none: two network namespaces, joined by a virtual cable.

Needs Linux, `ip` (iproute2) and root; without them it says so, and that is all.
"""

import os
import shutil
import subprocess
import sys
from pathlib import Path

here = Path(__file__).parent
sys.path.append(str(here.parent))

from server import serving  # noqa: E402 - it lies beside the folders of the examples

SIMULATOR, LAPTOP = f"simulator-{os.getpid()}", f"laptop-{os.getpid()}"
"""Names of the namespaces; several runs may go on at once."""


def main() -> int:
    """Returns the exit code of whichever part failed, or 0."""
    if sys.platform != "linux" or os.geteuid() != 0 or shutil.which("ip") is None:
        print("left out: two network namespaces need Linux, root and `ip` (Debian: apt-get install iproute2)")
        return 0
    if (tried := ip("netns", "add", SIMULATOR, check=False)).returncode != 0:
        print(f"left out: this machine lets nobody make network namespaces: {tried.stderr.strip()}")
        return 0
    try:
        connected()
        with serving(start()) as endpoint:
            print(f"laptop$ python examples/08_remote_machine/look.py {endpoint}", flush=True)
            return inside(LAPTOP, str(here / "look.py"), endpoint).wait()
    finally:
        # The cable goes with its ends.
        for namespace in (SIMULATOR, LAPTOP):
            ip("netns", "del", namespace, check=False)


def ip(*words: str, check: bool = True) -> "subprocess.CompletedProcess[str]":
    """Runs `ip`."""
    return subprocess.run(["ip", *words], capture_output=True, text=True, check=check)


def connected() -> None:
    """Adds the second namespace and a cable between the two, 10.99.0.1 and 10.99.0.2."""
    ip("netns", "add", LAPTOP)
    ip("link", "add", "eth0", "netns", SIMULATOR, "type", "veth", "peer", "name", "eth0", "netns", LAPTOP)
    for namespace, address in ((SIMULATOR, "10.99.0.1/24"), (LAPTOP, "10.99.0.2/24")):
        ip("-n", namespace, "address", "add", address, "dev", "eth0")
        for link in ("lo", "eth0"):
            ip("-n", namespace, "link", "set", link, "up")


def inside(namespace: str, *words: str) -> "subprocess.Popen[str]":
    """Starts Python in a namespace; its standard output is a pipe for the server only."""
    pipe = subprocess.PIPE if namespace == SIMULATOR else None
    return subprocess.Popen(["ip", "netns", "exec", namespace, sys.executable, *words], stdout=pipe, text=True)


def start() -> "subprocess.Popen[str]":
    """Starts a server with the configuration in the simulator's namespace."""
    print("simulator$ mjplug serve examples/08_remote_machine/config.yaml", flush=True)
    return inside(SIMULATOR, "-m", "mjplug", "serve", str(here / "config.yaml"))


if __name__ == "__main__":
    sys.exit(main())
