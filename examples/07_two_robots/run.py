"""Serves one configuration file twice, in two namespaces, and runs the script."""

import os
import subprocess
import sys
from contextlib import ExitStack
from pathlib import Path

FOLDER = Path(__file__).parent
sys.path.insert(0, str(FOLDER.parent))

from server import serving  # noqa: E402 - it is in the parent folder


def main() -> int:
    """Returns the exit code of the part that failed, or 0."""
    with ExitStack() as servers:
        red = servers.enter_context(serving(start("red")))
        servers.enter_context(serving(start("blue", "--connect", red)))
        print(f"$ MJPLUG_CONNECT={red} python examples/{FOLDER.name}/drive.py", flush=True)
        environment = os.environ | {"MJPLUG_CONNECT": red}
        return subprocess.run([sys.executable, FOLDER / "drive.py"], env=environment, check=False).returncode


def start(namespace: str, *options: str) -> "subprocess.Popen[str]":
    """Starts a server in a namespace, on a free port."""
    shown = ["--set", f"namespace={namespace}", *options]
    print(f"$ mjplug serve examples/{FOLDER.name}/config.yaml", *shown, flush=True)
    command = [sys.executable, "-m", "mjplug", "serve", str(FOLDER / "config.yaml"), *shown]
    return subprocess.Popen([*command, "--listen", "tcp/127.0.0.1:0"], stdout=subprocess.PIPE, text=True)


if __name__ == "__main__":
    sys.exit(main())
