"""Starts the server, waits until it is ready, drives it from a second process, and stops it."""

import re
import signal
import subprocess
import sys
from pathlib import Path

here = Path(__file__).parent


def main() -> int:
    """Runs the demo; returns the exit code of whichever part failed, or 0."""
    # A free port, so that the demo works beside another server.
    command = [sys.executable, "-m", "mjplug", "serve", str(here / "config.yaml"), "--listen", "tcp/127.0.0.1:0"]
    print("$ mjplug serve examples/03_camera/config.yaml", flush=True)
    server = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        assert server.stdout is not None
        endpoint = None
        for line in server.stdout:
            print(line, end="", flush=True)
            if found := re.search(r"ready.*?(tcp/\S+:\d+)", line):
                endpoint = found[1]
                break
        if endpoint is None:
            return server.wait()
        print(f"$ python examples/03_camera/take_pictures.py {endpoint}", flush=True)
        driven = subprocess.run([sys.executable, str(here / "take_pictures.py"), endpoint], check=False).returncode
    finally:
        server.send_signal(signal.SIGINT)
        stopped = server.wait(10)
    return driven or stopped


if __name__ == "__main__":
    sys.exit(main())
