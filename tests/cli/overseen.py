"""Stands in for a server with an overseer: python -m cli.overseen CASE. Prints the overseer's process number."""

import ctypes
import os
import signal
import socket
import sys
import time

from mjplug.lifecycle.overseer import Overseer

SECONDS = 0.3
EXIT_CODE = 40


def main(case):
    reader, writer = socket.socketpair()
    for end in (reader, writer):
        end.setblocking(False)
    overseer = Overseer(reader, SECONDS, EXIT_CODE)
    if case == "forks" and os.fork() == 0:
        # As a process that a library forks: it inherits every descriptor.
        time.sleep(1e9)
    print(overseer.pid, flush=True)
    if case == "dies at the dump":
        ctypes.CDLL(None).signal(41, 0)
    if case in ("hangs", "is suspended", "dies at the dump"):
        overseer.begin()
    elif case == "leaves a stop":
        writer.send(bytes([signal.SIGTERM]))
    elif case == "leaves another signal":
        writer.send(bytes([signal.SIGUSR1]))
    if case == "is suspended":
        os.kill(os.getpid(), signal.SIGSTOP)
    time.sleep(1e9)


main(sys.argv[1])
