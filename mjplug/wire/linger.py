"""Keeps the end of a link from stopping the other links.

Zenoh sets SO_LINGER to 10 s on the sockets of TCP and TLS links. On Linux, closing such a socket then blocks
for up to 10 s while the other side acknowledges nothing, although the socket is non-blocking. Zenoh closes sockets on
the two threads that receive for all links (eclipse-zenoh/zenoh#1101), so two readers that have stopped make every
request wait. Without SO_LINGER, the kernel sends what is left in the background, and `close` returns at once.
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
    """Switches SO_LINGER off for every present and future link of a session.

    Does nothing where it is not needed (only Linux blocks), or where this version of Zenoh does not report links.
    """
    declare = getattr(session.info, "declare_link_events_listener", None)
    if declare is not None and sys.platform.startswith("linux"):
        # A listener with a callback lives as long as its session.
        declare(callback(_link_changed), history=True)


def _link_changed(event: zenoh.LinkEvent) -> None:
    if event.kind != zenoh.SampleKind.PUT:
        return
    ports = _port(str(event.link.src)), _port(str(event.link.dst))
    if None in ports:
        # Only sockets with ports linger.
        return
    try:
        _switch_off(ports)
    except OSError as error:
        _log.warning("the link %s can delay others when it ends: %s", event.link.dst, error)


def _switch_off(ports: tuple[int | None, int | None]) -> None:
    """Switches SO_LINGER off for a stream socket of this process with these ports, here and at the other end.

    Two clients on different machines may use the same port. Only the socket of the new link still lingers.
    """
    # The newest file usually has the highest number.
    for number in sorted(map(int, os.listdir(_OPEN_FILES)), reverse=True):
        try:
            if not os.readlink(f"{_OPEN_FILES}/{number}").startswith("socket:"):
                continue
            found = socket.socket(fileno=number)
        except OSError:
            # Closed since the folder was listed.
            continue
        try:
            if found.family not in (socket.AF_INET, socket.AF_INET6) or found.type != socket.SOCK_STREAM:
                continue
            if (found.getsockname()[1], found.getpeername()[1]) == ports and _lingers(found):
                found.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _OFF)
                return
        except OSError:
            # A socket that listens, or whose other end has gone.
            continue
        finally:
            # The socket is Zenoh's to close.
            found.detach()


def _lingers(found: socket.socket) -> bool:
    (on, _) = struct.unpack("ii", found.getsockopt(socket.SOL_SOCKET, socket.SO_LINGER, len(_OFF)))
    return bool(on)


def _port(locator: str) -> int | None:
    """Returns the port of a locator such as `tcp/127.0.0.1:7447`, or None."""
    text = locator.partition("?")[0].partition("#")[0].rpartition(":")[2]
    return int(text) if text.isdecimal() else None
