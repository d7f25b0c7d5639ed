"""Waits for the server of an example, and stops it with SIGINT."""

import contextlib
import re
import signal
import subprocess
import sys
from collections.abc import Iterator


@contextlib.contextmanager
def serving(server: "subprocess.Popen[str]") -> Iterator[str]:
    """Waits until a server is ready, yields its endpoint, and stops the server at the end of the block.

    Args:
        server: The process of the server; its standard output is a pipe.
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
