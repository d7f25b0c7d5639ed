"""The file of `mjplug view --record`: one HTML file with the page, the drawing pack and the frames.

After the page come chunks, each in a `<script>` element that no browser runs: `scene` is a drawing pack, `items` are
the information and the frames of a few seconds, compressed with gzip. Both are in base64, and `data-size` is the length
of the text. Chunks are appended while recording runs, so a file without its end can be played too.
"""

import base64
import gzip
import html
import json
import struct
from pathlib import Path
from types import TracebackType
from typing import IO

from mjplug.errors import MjplugError

FORMAT = 1
"""Version of the format."""

INFO, FRAME = 0, 1
"""Kinds of items."""

CHUNK_TIME = 4.0
"""Wall time of a chunk [s]; a recorder that is killed loses at most this."""

FIRST_CHUNK_TIME = 1.0
"""Wall time of the first chunk [s], so that a short recording is not lost completely."""

CHUNK_BYTES = 1 << 20
"""A chunk ends when it contains this much [bytes]."""

_ITEM = struct.Struct("<IId")
"""Kind, length [bytes], wall time [s since 1970]; then the bytes, and padding to a multiple of 8."""

_GZIP_LEVEL = 6
_POLICY = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:"


class Recording:
    """Writes a recording; memory does not grow with its length.

    Attributes:
        size: Number of bytes written.

    Args:
        path: The file; it must not exist.
        page: Folder of the built page.
        server: The server's full name.
        version: Version of mjplug.

    Raises:
        MjplugError: The file exists, or it or the page cannot be used.
    """

    def __init__(self, path: Path, page: Path, server: str, version: str) -> None:
        self.size = 0
        self._path = path
        start = _start(page, server, version)
        try:
            self._file: IO[bytes] = path.open("xb", buffering=0)
        except FileExistsError:
            raise MjplugError(f"{path} already exists; remove it, or choose another name") from None
        except OSError as error:
            raise MjplugError(f"cannot write {path}: {error.strerror or error}") from error
        self._info = b""
        self._items: list[bytes] = []
        self._bytes = 0
        self._flushed = False
        self._times: list[float] = []
        self._write(start)

    def __enter__(self) -> "Recording":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def add_scene(self, hash: str, pack: bytes) -> None:
        """Adds a drawing pack.

        Args:
            hash: Its SHA-256, hexadecimal.
            pack: The pack, compressed with gzip.
        """
        self._write_chunk("scene", {"hash": hash}, pack)

    def set_info(self, time: float, info: bytes) -> None:
        """Adds the information about the server that holds from a time on.

        Args:
            time: Wall time [s since 1970].
            info: The bytes of `@view/info`.
        """
        self._info = info
        if self._items:
            self._add(INFO, time, info)

    def add_frame(self, time: float, frame: bytes) -> None:
        """Adds a frame.

        Args:
            time: Wall time of the frame [s since 1970].
            frame: The bytes of `@view/frame`.
        """
        if not self._items:
            # Each chunk has the information, so that a player can begin anywhere.
            self._add(INFO, time, self._info)
        self._add(FRAME, time, frame)
        self._times.append(time)
        limit = CHUNK_TIME if self._flushed else FIRST_CHUNK_TIME
        if self._bytes >= CHUNK_BYTES or time - self._times[0] >= limit:
            self.flush()

    def flush(self) -> None:
        """Writes the frames that have not been written."""
        if not self._times:
            return
        content = gzip.compress(b"".join(self._items), _GZIP_LEVEL, mtime=0)
        fields = {"from": repr(self._times[0]), "to": repr(self._times[-1]), "frames": str(len(self._times))}
        self._flushed = True
        self._items.clear()
        self._times.clear()
        self._bytes = 0
        self._write_chunk("items", fields, content)

    def close(self) -> None:
        """Completes the file; a second call does nothing."""
        if self._file.closed:
            return
        try:
            self.flush()
            self._write(b"</body>\n</html>\n")
        finally:
            self._file.close()

    def _add(self, kind: int, time: float, content: bytes) -> None:
        padded = b"".join((_ITEM.pack(kind, len(content), time), content, bytes(-len(content) % 8)))
        self._items.append(padded)
        self._bytes += len(padded)

    def _write_chunk(self, kind: str, fields: dict[str, str], content: bytes) -> None:
        text = base64.b64encode(content)
        given = "".join(f' data-{name}="{html.escape(value)}"' for name, value in fields.items())
        start = f'<script type="application/octet-stream" data-mjplug="{kind}" data-size="{len(text)}"{given}>'
        # In one call, so that a recorder that is killed leaves complete chunks.
        self._write(b"%b%b</script>\n" % (start.encode(), text))

    def _write(self, content: bytes) -> None:
        try:
            rest = memoryview(content)
            while rest:
                rest = rest[self._file.write(rest) :]
        except OSError as error:
            raise MjplugError(f"cannot write {self._path}: {error.strerror or error}") from error
        self.size += len(content)


def _start(page: Path, server: str, version: str) -> bytes:
    """Returns the page, as the start of the file."""
    try:
        script, style, licences = ((page / name).read_text("utf-8") for name in ("page.js", "page.css", "licences.txt"))
    except OSError as error:
        raise MjplugError(f"the page is incomplete: {error.filename} cannot be read") from error
    about = json.dumps({"format": FORMAT, "server": server, "version": version})
    title = html.escape(f"{server} - mjplug")
    return f"""<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="{_POLICY}">
<meta name="viewport" content="width=device-width, initial-scale=1, viewport-fit=cover">
<meta name="color-scheme" content="dark light">
<title>{title}</title>
<link rel="icon" href="data:,">
<style>{_inside(style, "style")}</style>
<script type="application/json" id="mjplug-recording">{_inside(about, "script")}</script>
<script type="text/plain" id="licences">{_inside(licences, "script")}</script>
<script type="module">{_inside(script, "script")}</script>
</head>
<body>
""".encode()


def _inside(text: str, element: str) -> str:
    """Returns a text that does not end the element in which it is; JavaScript and JSON read it as the original."""
    # Without a comment before it, `<script` has no meaning inside a script.
    return text.replace("<!--", "<\\!--").replace(f"</{element}", f"<\\/{element}")
