"""A small process that ends the server's process if Python itself hangs during a stop.

Both processes have the socket to which the C part of Python's signal handling writes. While Python runs, the watchdog's
thread reads each byte at once; if a byte stays in the socket, no Python code runs.
"""

import contextlib
import ctypes
import faulthandler
import os
import socket
import subprocess
import sys
import threading
from pathlib import Path

_PROGRAM = Path(__file__).with_name("overseer_process.py")

_DUMP_SIGNAL = 41
"""Real-time signal at which `faulthandler` writes the traceback of each thread."""

_SIG_IGN = 1
"""The value of SIG_IGN in C."""


class Overseer:
    """The process and the pipes to it.

    Attributes:
        pid: The process id.

    Args:
        signals: The socket from which the watchdog reads the numbers of signals.
        seconds: Time from the first signal, or from `begin`, to the forced end [s].
        exit_code: The exit code after a forced end. It is also the number of the real-time signal that is sent.
            The handler of this signal is libc's `_exit`, which needs no Python and gets the number as its argument.

    Raises:
        OSError: The platform has no real-time signals or no pidfd, or the process cannot be started.
    """

    def __init__(self, signals: socket.socket, seconds: float, exit_code: int) -> None:
        if sys.platform != "linux":
            raise OSError("only Linux has real-time signals and pidfd")
        libc = ctypes.CDLL(None)
        libc.signal.argtypes = (ctypes.c_int, ctypes.c_void_p)
        libc.signal(exit_code, ctypes.cast(libc._exit, ctypes.c_void_p))
        # faulthandler restores this handler when Python ends. With the default one, the signal would end the
        # process with another code.
        libc.signal(_DUMP_SIGNAL, _SIG_IGN)
        dump_reader, dump_writer = os.pipe()
        control_reader, self._control = os.pipe()
        # A signal handler writes to it, and must not block if the pipe is full.
        os.set_blocking(dump_writer, False)
        self._dump = os.fdopen(dump_writer, "wb", buffering=0)
        faulthandler.register(_DUMP_SIGNAL, self._dump, all_threads=True, chain=False)
        descriptors = (signals.fileno(), control_reader, dump_reader)
        thread = threading.main_thread().ident
        numbers = (os.getpid(), seconds, *descriptors, thread, _DUMP_SIGNAL, exit_code)
        try:
            process = subprocess.Popen(
                # Without site-packages: it needs only the standard library, and starts in 10 ms.
                [sys.executable, "-I", "-S", str(_PROGRAM), *map(str, numbers)],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                pass_fds=descriptors,
                # In a separate process group, so that Ctrl-C in a terminal does not reach it.
                process_group=0,
            )
        finally:
            os.close(control_reader)
            os.close(dump_reader)
        self.pid = process.pid
        # Stored, because Python warns when the object of a running process is deleted.
        self._process = process

    def begin(self) -> None:
        """Reports that the server begins to stop."""
        self._send(b"s")

    def forcing(self) -> None:
        """Reports that the watchdog ends the server, and prints the reason itself."""
        self._send(b"f")

    def _send(self, what: bytes) -> None:
        with contextlib.suppress(OSError):
            os.write(self._control, what)
