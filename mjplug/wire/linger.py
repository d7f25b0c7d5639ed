"""Prevents the end of one link from blocking the other links.

Zenoh sets SO_LINGER to 10 s on the sockets of TCP and TLS links. On Linux, closing such a socket blocks for up to 10 s
if the other side does not acknowledge data, although the socket is non-blocking. Zenoh closes sockets on the two
threads that receive for all links (eclipse-zenoh/zenoh#1101), so two stopped clients can block all requests. Without
SO_LINGER, the kernel sends the remaining data in the background, and `close` returns at once.
"""

import logging
import os
import socket
import struct
import sys

import zenoh

from mjplug.wire.callbacks import callback

_log = logging.getLogger(__name__)

_OPEN_FILES = "/proc/self/fd"
_OFF = struct.pack("ii", 0, 0)


def watch(session: zenoh.Session) -> None:
    """Turns off SO_LINGER for every current and future link of a session.

    Does nothing except on Linux, or if this version of Zenoh does not report links.
    """
    declare = getattr(session.info, "declare_link_events_listener", None)
    if declare is not None and sys.platform.startswith("linux"):
        # A listener with a callback exists as long as its session.
        declare(callback(_link_changed), history=True)


def _link_changed(event: zenoh.LinkEvent) -> None:
    if event.kind != zenoh.SampleKind.PUT:
        return
    ports = _port(str(event.link.src)), _port(str(event.link.dst))
    if None in ports:
        # Only sockets with ports use SO_LINGER.
        return
    try:
        _switch_off(ports)
    except OSError as error:
        _log.warning(
            "SO_LINGER of the link %s could not be turned off, so its end may block other links: %s",
            event.link.dst,
            error,
        )


def _switch_off(ports: tuple[int | None, int | None]) -> None:
    """Turns off SO_LINGER for the stream socket of this process with these local and remote ports.

    Two clients on different machines may use the same port; of their sockets, only that of the new link still has
    SO_LINGER.
    """
    # The newest file descriptor usually has the highest number.
    for number in sorted(map(int, os.listdir(_OPEN_FILES)), reverse=True):
        try:
            if not os.readlink(f"{_OPEN_FILES}/{number}").startswith("socket:"):
                continue
            found = socket.socket(fileno=number)
        except OSError:
            # The file descriptor was closed after the folder was listed.
            continue
        try:
            if found.family not in (socket.AF_INET, socket.AF_INET6) or found.type != socket.SOCK_STREAM:
                continue
            if (found.getsockname()[1], found.getpeername()[1]) == ports and _lingers(found):
                found.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _OFF)
                return
        except OSError:
            # The socket listens, or its other end was closed.
            continue
        finally:
            # Zenoh closes the socket.
            found.detach()


def _lingers(found: socket.socket) -> bool:
    (on, _) = struct.unpack("ii", found.getsockopt(socket.SOL_SOCKET, socket.SO_LINGER, len(_OFF)))
    return bool(on)


def _port(locator: str) -> int | None:
    """Returns the port of a locator such as `tcp/127.0.0.1:7447`, or None."""
    text = locator.partition("?")[0].partition("#")[0].rpartition(":")[2]
    return int(text) if text.isdecimal() else None
