"""Tells systemd, or another service manager with its protocol, how the server is: sd_notify without a library."""

import logging
import os
import socket
import threading
from collections.abc import MutableMapping

from mjplug.physics.inbox import Inbox

_log = logging.getLogger(__name__)


class ServiceManager:
    """The socket that `NOTIFY_SOCKET` names; without that variable, nothing is sent.

    Args:
        environ: The environment. The variables are removed, so that processes started by the server do not send
            notifications for it.
    """

    def __init__(self, environ: MutableMapping[str, str] = os.environ) -> None:
        self._address = environ.pop("NOTIFY_SOCKET", "")
        interval, pid = environ.pop("WATCHDOG_USEC", ""), environ.pop("WATCHDOG_PID", "")
        self._watchdog = int(interval) / 1e6 if interval.isdigit() and pid in ("", str(os.getpid())) else 0.0
        self._stopping = threading.Event()
        self._socket: socket.socket | None = None
        if self._address and hasattr(socket, "AF_UNIX"):
            self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
            # A service manager that does not read must not delay the server.
            self._socket.setblocking(False)

    def status(self, text: str) -> None:
        """Sends the text that `systemctl status` shows."""
        self._send(f"STATUS={text}")

    def ready(self, text: str, inbox: Inbox) -> None:
        """Reports that the server is ready; with a watchdog, starts to report progress of the physics thread.

        Args:
            text: The text that `systemctl status` shows.
            inbox: Passes calls to the physics thread.
        """
        self._send(f"READY=1\nSTATUS={text}")
        if self._socket is not None and self._watchdog > 0.0:
            threading.Thread(target=self._keep_alive, args=(inbox,), name="service manager", daemon=True).start()

    def stopping(self) -> None:
        """Reports that the server stops. Nothing is sent afterwards."""
        self._stopping.set()
        self._send("STOPPING=1\nSTATUS=stopping")
        unused, self._socket = self._socket, None
        if unused is not None:
            unused.close()

    def _keep_alive(self, inbox: Inbox) -> None:
        """Sends `WATCHDOG=1` twice in each interval, but only if the physics thread has run a call since the last one.

        If the loop hangs, or a step takes longer than the interval, nothing is sent.
        """
        while not self._stopping.wait(self._watchdog / 2):
            progress = threading.Event()
            inbox.post(progress.set)
            progress.wait()
            self._send("WATCHDOG=1")

    def _send(self, text: str) -> None:
        to = self._socket
        if to is None:
            return
        # A name that begins with @ is in Linux's abstract namespace.
        address = f"\0{self._address[1:]}" if self._address.startswith("@") else self._address
        try:
            to.sendto(text.encode(), address)
        except OSError as error:
            _log.warning("cannot notify the service manager at NOTIFY_SOCKET=%s: %s", self._address, error)
