"""Answers HTTP requests: the files of the page, drawing packs, and the upgrade to a WebSocket."""

import re
from collections.abc import Awaitable, Callable
from email.utils import formatdate
from http import HTTPStatus
from urllib.parse import unquote

from websockets.datastructures import Headers
from websockets.http11 import Request, Response

from mjplug.client.errors import ClientError
from mjplug.view.access import Access, Refusal
from mjplug.view.built_page import BuiltPage, what_to_do

_POLICY = (
    "default-src 'self'; img-src 'self' blob: data:; style-src 'self' 'unsafe-inline'; connect-src 'self'; "
    "object-src 'none'; base-uri 'none'; form-action 'none'; frame-ancestors {ancestors}"
)

_HASH = re.compile(r"[0-9a-f]{64}")


class Web:
    """Routes HTTP requests. A prefix of the path is ignored, so that the page works behind a proxy.

    Args:
        access: Decides about requests.
        page: The files of the page.
        scene: Returns the drawing pack with a hash.
        frame_ancestors: Origins that may embed the page in a frame, as in the header Content-Security-Policy.
    """

    def __init__(
        self,
        access: Access,
        page: BuiltPage,
        scene: Callable[[str], Awaitable[bytes]],
        frame_ancestors: str = "'none'",
    ) -> None:
        self._access = access
        self._page = page
        self._scene = scene
        self._policy = _POLICY.format(ancestors=frame_ancestors)

    async def answer(self, request: Request) -> Response | None:
        """Returns the response to a request; None upgrades the connection to a WebSocket."""
        path, _, query = request.path.partition("?")
        segments = [unquote(segment) for segment in path.split("/")[1:]] or [""]
        try:
            token_in_query = self._access.check(request.headers, segments, query)
        except Refusal as refusal:
            return self._text(HTTPStatus.FORBIDDEN, str(refusal))
        method = getattr(request, "method", "GET")
        if method != "GET":
            return self._text(HTTPStatus.METHOD_NOT_ALLOWED, f"the method is {method}; only GET is allowed")
        name = segments[-1]
        if name == "socket":
            if request.headers.get("Upgrade", "").lower() == "websocket":
                return None
            return self._text(HTTPStatus.UPGRADE_REQUIRED, "this is the address of a WebSocket")
        if token_in_query:
            return self._with_cookie(path)
        if len(segments) > 1 and segments[-2] == "scene":
            return await self._pack(name)
        return self._file(segments, request.headers)

    async def _pack(self, hash: str) -> Response:
        if not _HASH.fullmatch(hash):
            return self._text(HTTPStatus.NOT_FOUND, "the hash of a scene has 64 hexadecimal digits")
        try:
            pack = await self._scene(hash)
        except ClientError as error:
            return self._text(HTTPStatus.NOT_FOUND, str(error))
        return self._response(
            HTTPStatus.OK,
            pack,
            ("Content-Type", "application/octet-stream"),
            ("Content-Encoding", "gzip"),
            ("Cache-Control", "private, max-age=31536000, immutable"),
        )

    def _file(self, segments: list[str], headers: Headers) -> Response:
        if not self._page.built:
            return self._text(HTTPStatus.NOT_FOUND, what_to_do())
        path = [*segments[:-1], segments[-1] or "index.html"]
        found = (self._page.find("/".join(path[start:])) for start in range(len(path)))
        file = next((file for file in found if file is not None), None)
        if file is None:
            return self._text(HTTPStatus.NOT_FOUND, "there is no such file")
        common = [("ETag", file.tag), ("Cache-Control", "no-cache"), ("Vary", "Accept-Encoding")]
        if file.tag in headers.get_all("If-None-Match"):
            return self._response(HTTPStatus.NOT_MODIFIED, b"", *common)
        common.append(("Content-Type", file.type))
        if file.compressed is not None and "gzip" in ",".join(headers.get_all("Accept-Encoding")):
            return self._response(HTTPStatus.OK, file.compressed, *common, ("Content-Encoding", "gzip"))
        return self._response(HTTPStatus.OK, file.content, *common)

    def _with_cookie(self, path: str) -> Response:
        """Returns a redirection to the same page without the token, which would else stay in the history."""
        cookie = f"{self._access.cookie}={self._access.token}; Path=/; HttpOnly; SameSite=Strict"
        # Relative, so that a proxy's prefix remains.
        place = "./" if path.endswith("/") else path.rpartition("/")[2]
        return self._response(
            HTTPStatus.SEE_OTHER, b"", ("Location", place), ("Set-Cookie", cookie), ("Cache-Control", "no-store")
        )

    def _text(self, status: HTTPStatus, text: str) -> Response:
        return self._response(
            status, f"{text}\n".encode(), ("Content-Type", "text/plain; charset=utf-8"), ("Cache-Control", "no-store")
        )

    def _response(self, status: HTTPStatus, body: bytes, *more: tuple[str, str]) -> Response:
        headers = Headers(
            [
                ("Date", formatdate(usegmt=True)),
                ("Connection", "close"),
                ("Content-Length", str(len(body))),
                ("Content-Security-Policy", self._policy),
                ("X-Content-Type-Options", "nosniff"),
                ("Referrer-Policy", "no-referrer"),
                ("Cross-Origin-Resource-Policy", "same-origin"),
                ("Cross-Origin-Opener-Policy", "same-origin"),
                *more,
            ]
        )
        return Response(status, status.phrase, headers, body)
