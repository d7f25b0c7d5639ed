"""A server as an example runs it: shown while it starts, and stopped as Ctrl-C would."""

import contextlib
import re
import signal
import subprocess
import sys
from collections.abc import Iterator


@contextlib.contextmanager
def serving(server: "subprocess.Popen[str]") -> Iterator[str]:
    """Waits until a server is ready, and stops it when the block ends; the value is its endpoint.

    Args:
        server: The process; its standard output is a pipe.
    """
    assert server.stdout is not None
    try:
        for line in server.stdout:
            print(line, end="", flush=True)
            if found := re.search(r"^ready · (\S+)", line):
                yield found[1]
                break
        else:
            sys.exit(server.wait())
    finally:
        server.send_signal(signal.SIGINT)
        stopped = server.wait(10)
        server.stdout.close()
    if stopped:
        sys.exit(stopped)
