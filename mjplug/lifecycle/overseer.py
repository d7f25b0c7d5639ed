"""A small process that ends this one if Python itself hangs while the server is to stop.

It shares the socket to which the C part of Python's signal handling writes. While Python runs, the watchdog's thread
takes each byte at once; a byte that stays there means that no Python code runs.
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
"""The real-time signal at which the C part of Python writes down where each thread is."""

_SIG_IGN = 1
"""The C constant."""


class Overseer:
    """The process, and the pipes to it.

    Attributes:
        pid: Its number.

    Args:
        signals: The socket with the signals' numbers.
        seconds: Time from the first signal, or from `begin`, to the forced end [s].
        exit_code: The exit code after a forced end. It is also the real-time signal that the process sends: its handler
            is libc's `_exit`, which needs no Python and gets the signal's number as its argument.

    Raises:
        OSError: The platform lacks what it needs, or the process cannot be started.
    """

    def __init__(self, signals: socket.socket, seconds: float, exit_code: int) -> None:
        if sys.platform != "linux":
            raise OSError("only Linux has real-time signals and pidfd")
        libc = ctypes.CDLL(None)
        libc.signal.argtypes = (ctypes.c_int, ctypes.c_void_p)
        libc.signal(exit_code, ctypes.cast(libc._exit, ctypes.c_void_p))
        # What faulthandler puts back when Python ends: without it, the signal would end the process with another code.
        libc.signal(_DUMP_SIGNAL, _SIG_IGN)
        dump_reader, dump_writer = os.pipe()
        control_reader, self._control = os.pipe()
        # Written in a signal handler: a full pipe must not block it.
        os.set_blocking(dump_writer, False)
        self._dump = os.fdopen(dump_writer, "wb", buffering=0)
        faulthandler.register(_DUMP_SIGNAL, self._dump, all_threads=True, chain=False)
        descriptors = (signals.fileno(), control_reader, dump_reader)
        thread = threading.main_thread().ident
        numbers = (os.getpid(), seconds, *descriptors, thread, _DUMP_SIGNAL, exit_code)
        try:
            process = subprocess.Popen(
                # Without site-packages: it needs the standard library alone, and starts in 10 ms.
                [sys.executable, "-I", "-S", str(_PROGRAM), *map(str, numbers)],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                pass_fds=descriptors,
                # A group of its own: Ctrl-C in a terminal is the server's to handle.
                process_group=0,
            )
        finally:
            os.close(control_reader)
            os.close(dump_reader)
        self.pid = process.pid
        # Kept, since Python warns of a process that is forgotten while it runs.
        self._process = process

    def begin(self) -> None:
        """Says that the server is about to end."""
        self._tell(b"s")

    def forcing(self) -> None:
        """Says that the server is about to end by force, and names what hung itself."""
        self._tell(b"f")

    def _tell(self, what: bytes) -> None:
        with contextlib.suppress(OSError):
            os.write(self._control, what)
