"""Runs an example: starts its server, waits until it is ready, runs its script, and stops the server.

Usage: python examples/run.py NAME      (a folder of this one, such as 00_push_a_box)

The server uses `config.yaml` of the folder. The script is the file with a usage line. It gets the endpoint of the
server as its argument and in the environment variable MJPLUG_CONNECT. If the folder contains a `run.py`, that is run
instead.
"""

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
    with serving(start(folder / "config.yaml")) as endpoint:
        (script,) = (path for path in folder.glob("*.py") if "\nUsage: python " in path.read_text(encoding="utf-8"))
        print(f"$ MJPLUG_CONNECT={endpoint} python examples/{folder.name}/{script.name}", flush=True)
        environment = os.environ | {"MJPLUG_CONNECT": endpoint}
        return subprocess.run([sys.executable, script, endpoint], env=environment, check=False).returncode


def start(config: Path) -> "subprocess.Popen[str]":
    """Starts a server with a configuration file."""
    print(f"$ mjplug serve examples/{config.parent.name}/{config.name}", flush=True)
    command = [sys.executable, "-m", "mjplug", "serve", str(config)]
    # With port 0, an example also works if another server uses port 7447.
    return subprocess.Popen([*command, "--listen", "tcp/127.0.0.1:0"], stdout=subprocess.PIPE, text=True)


if __name__ == "__main__":
    sys.exit(main())
