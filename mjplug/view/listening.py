"""The TCP sockets on which the relay listens."""

import errno
import socket
from dataclasses import dataclass

from mjplug.errors import WireError
from mjplug.view.access import is_loopback

_ATTEMPTS = 20
"""Number of ports that are tried, one after the other."""

_BACKLOG = 128


@dataclass(frozen=True, slots=True)
class Listening:
    """Sockets that listen on one port.

    Attributes:
        host: The address that was asked for.
        port: The port.
        sockets: The sockets, one for each address of the host.
    """

    host: str
    port: int
    sockets: tuple[socket.socket, ...]

    @property
    def loopback(self) -> bool:
        """Whether only this machine can connect."""
        return is_loopback(self.host)

    def url(self, token: str | None) -> str:
        """Returns the address of the page for a browser; with a token, for a browser that does not have the cookie."""
        host = socket.gethostname() if self.host in ("", "0.0.0.0", "::", "*") else self.host
        host = f"[{host}]" if ":" in host else host
        return f"http://{host}:{self.port}/" + ("" if token is None else f"?token={token}")

    def close(self) -> None:
        """Closes the sockets."""
        for each in self.sockets:
            each.close()


def listen(host: str, port: int, search: bool = True) -> Listening:
    """Listens on an address.

    Args:
        host: Name or address of an interface of this machine.
        port: The port; 0 means any free port.
        search: Whether to try the following ports if the port is in use.

    Raises:
        WireError: The address does not belong to this machine, or no port is free.
    """
    host = host.strip("[]")
    last = min(port + _ATTEMPTS, 65536) if search and port else port + 1
    for candidate in range(port, last):
        try:
            return _open(host, candidate)
        except OSError as error:
            if error.errno == errno.EACCES:
                raise WireError(f"port {candidate} needs the rights of root; choose one above 1023") from None
            if error.errno != errno.EADDRINUSE:
                raise WireError(f"cannot listen on {host} port {candidate}: {error.strerror or error}") from None
    if search and port:
        return _open(host, 0)
    raise WireError(f"port {port} is in use; choose another one with --port, or 0 for any free port")


def _open(host: str, port: int) -> Listening:
    name = None if host in ("", "*") else host
    addresses = socket.getaddrinfo(name, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)
    sockets: list[socket.socket] = []
    try:
        for family, _, _, _, address in dict.fromkeys(addresses):
            try:
                each = socket.socket(family, socket.SOCK_STREAM)
            except OSError:
                # The system has no IPv6.
                continue
            sockets.append(each)
            each.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            if family == socket.AF_INET6:
                each.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY, 1)
            each.bind((address[0], port, *address[2:]))
            each.listen(_BACKLOG)
            each.setblocking(False)
            # With port 0, all addresses get the same port.
            port = each.getsockname()[1]
    except BaseException:
        for each in sockets:
            each.close()
        raise
    if not sockets:
        raise OSError(errno.EADDRNOTAVAIL, f"{host} has no address of this machine")
    return Listening(host, port, tuple(sockets))
