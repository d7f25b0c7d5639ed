"""Which HTTP requests are answered: Host, Origin and token.

Any web page that the user opens can send requests to 127.0.0.1. The check of Origin refuses its WebSocket. The check of
Host refuses a page whose own name has been changed to resolve to this machine (DNS rebinding).
"""

import hmac
import ipaddress
import secrets
import socket
from collections.abc import Collection, Iterable
from http.cookies import CookieError, SimpleCookie
from urllib.parse import parse_qs, urlsplit

from websockets.datastructures import Headers

_TOKEN_BYTES = 24


def new_token() -> str:
    """Returns a random token."""
    return secrets.token_urlsafe(_TOKEN_BYTES)


def is_loopback(host: str) -> bool:
    """Returns whether an address to listen on is reachable from this machine only."""
    try:
        return ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return host == "localhost"


def own_names() -> set[str]:
    """Returns the names of this machine, in lower case."""
    name = socket.gethostname().lower()
    return {name, f"{name}.local", socket.getfqdn().lower()} - {""}


class Refusal(Exception):  # noqa: N818  (not an error of the relay)
    """A request is refused; the text is a sentence for the user."""


class Access:
    """Decides about requests.

    Attributes:
        token: The token that each request needs; None if none is needed.
        cookie: Name of the cookie that contains the token.

    Args:
        host: The address on which the relay listens.
        port: The port.
        token: As above.
        origins: Further origins, such as `https://example.org`, from which a reverse proxy serves the page.
    """

    def __init__(self, host: str, port: int, token: str | None, origins: Collection[str] = ()) -> None:
        self.token = token
        # Cookies do not depend on the port, and several relays may run on one machine.
        self.cookie = f"mjplug_view_{port}"
        self._origins = frozenset(origins)
        self._hosts = {"localhost", host.lower().strip("[]")} | {urlsplit(origin).hostname or "" for origin in origins}
        self._any_address = not is_loopback(host)
        if self._any_address:
            self._hosts |= own_names()

    def check(self, headers: Headers, segments: Iterable[str], query: str) -> bool:
        """Checks a request.

        Args:
            headers: Its headers.
            segments: The parts of its path.
            query: Its query.

        Returns:
            Whether the token is in the query, so that the browser needs the cookie.

        Raises:
            Refusal: The request is not permitted.
        """
        host = _single(headers, "Host")
        if host is None or not self._own(_hostname(host)):
            raise Refusal(
                f"the request is for the host {host!r}; use the URL that `mjplug view` has printed, or permit a "
                "reverse proxy with --origin"
            )
        origins = headers.get_all("Origin")
        if origins and not all(origin in self._origins or _same(origin, host) for origin in origins):
            raise Refusal(f"the page comes from {origins[0]!r}, not from {host!r}; permit it with --origin")
        return self._check_token(headers, segments, query)

    def _check_token(self, headers: Headers, segments: Iterable[str], query: str) -> bool:
        if self.token is None:
            return False
        given = parse_qs(query).get("token", ())
        if any(map(self._is_token, given)):
            return True
        if self._is_token(_cookie(headers, self.cookie)) or any(map(self._is_token, segments)):
            return False
        raise Refusal("the token is missing or wrong; open the URL that `mjplug view` has printed")

    def _is_token(self, text: str) -> bool:
        # In constant time, so that the time of the response does not depend on the number of right characters.
        return self.token is not None and hmac.compare_digest(text.encode(), self.token.encode())

    def _own(self, host: str) -> bool:
        try:
            address = ipaddress.ip_address(host)
        except ValueError:
            return host in self._hosts
        # A name is needed for rebinding, so addresses are safe.
        return self._any_address or address.is_loopback


def _single(headers: Headers, name: str) -> str | None:
    values = headers.get_all(name)
    return values[0] if len(values) == 1 else None


def _hostname(host: str) -> str:
    try:
        return (urlsplit(f"//{host}").hostname or "").lower()
    except ValueError:
        return ""


def _same(origin: str, host: str) -> bool:
    scheme, separator, rest = origin.partition("://")
    return scheme in ("http", "https") and bool(separator) and rest.lower() == host.lower()


def _cookie(headers: Headers, name: str) -> str:
    for header in headers.get_all("Cookie"):
        try:
            found = SimpleCookie(header).get(name)
        except CookieError:
            continue
        if found is not None:
            return found.value
    return ""
