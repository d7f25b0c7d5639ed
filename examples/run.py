"""Runs an example: starts its servers, waits until they are ready, runs its script, and stops the servers.

Usage: python examples/run.py NAME      (a folder of this one, such as 00_push_a_box)

Each configuration file of the folder starts a server; the second and later ones connect to the first. The script is the
file with a usage line. It gets the endpoint of the first server as its argument and in the environment variable
MJPLUG_CONNECT. If the folder contains a `run.py`, that is run instead.
"""

import contextlib
import os
import subprocess
import sys
from pathlib import Path

from server import serving

EXAMPLES = Path(__file__).parent


def main() -> int:
    """Returns the exit code of the part that failed, or 0."""
    known = sorted(config.parent.name for config in EXAMPLES.glob("*/config.yaml"))
    if len(sys.argv) != 2 or sys.argv[1].rstrip("/") not in known:
        print(f"usage: python examples/run.py NAME, one of: {', '.join(known)}", file=sys.stderr)
        return 2
    folder = EXAMPLES / sys.argv[1].rstrip("/")
    if (folder / "run.py").exists():
        return subprocess.run([sys.executable, folder / "run.py"], check=False).returncode
    with contextlib.ExitStack() as servers:
        endpoint = ""
        for config in sorted(folder.glob("*.yaml")):
            joined = servers.enter_context(serving(start(config, endpoint)))
            endpoint = endpoint or joined
        (script,) = (path for path in folder.glob("*.py") if "\nUsage: python " in path.read_text(encoding="utf-8"))
        print(f"$ MJPLUG_CONNECT={endpoint} python examples/{folder.name}/{script.name}", flush=True)
        environment = os.environ | {"MJPLUG_CONNECT": endpoint}
        return subprocess.run([sys.executable, script, endpoint], env=environment, check=False).returncode


def start(config: Path, router: str) -> "subprocess.Popen[str]":
    """Starts a server with a configuration file.

    Args:
        config: The file.
        router: Endpoint of another server to connect to; empty for none.
    """
    shown = ["mjplug", "serve", f"examples/{config.parent.name}/{config.name}", *(["--connect", router] * bool(router))]
    print("$", *shown, flush=True)
    command = [sys.executable, "-m", "mjplug", "serve", str(config), *shown[3:]]
    # With port 0, an example also works if another server uses port 7447.
    return subprocess.Popen([*command, "--listen", "tcp/127.0.0.1:0"], stdout=subprocess.PIPE, text=True)


if __name__ == "__main__":
    sys.exit(main())
