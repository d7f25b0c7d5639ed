"""Records a server into a file that any browser plays."""

import hashlib
import json
import struct
import threading
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from time import monotonic, time

import zenoh
from zenoh.handlers import Callback

from mjplug.client import Client
from mjplug.client.errors import ClientError
from mjplug.client.view_query import query
from mjplug.view.built_page import FOLDER, BuiltPage
from mjplug.view.recording import Recording
from mjplug.wakeup import Wakeup
from mjplug_schemas import names

MAX_WAITING = 32 << 20
"""Maximum total size of the frames that wait for a slow disk [bytes]; the oldest are dropped."""

_TIMEOUT = 120.0
"""Timeout of a query [s]; the server makes the drawing pack of a large model at the first query."""

_SILENCE = 3.0
"""The server sends a frame at least once a second. After this time without one [s], it may have started again."""

_PROGRESS_PERIOD = 1.0
_FRAME = struct.Struct("<ddIIH")
"""Simulated time, wall time, epoch, step, flags."""


@dataclass(frozen=True, slots=True)
class Progress:
    """What has been recorded.

    Attributes:
        seconds: Wall time from the first to the last frame [s].
        frames: Number of frames.
        lost: Number of frames that were dropped, because the disk is too slow.
        size: Size of the file [bytes].
        silent: Whether the server sends nothing now.
    """

    seconds: float
    frames: int
    lost: int
    size: int
    silent: bool


@dataclass(frozen=True, slots=True)
class Limits:
    """What to record.

    Attributes:
        rate: Maximum number of frames per second of wall time [Hz].
        duration: When to end [s of wall time]; infinite without limit.
    """

    rate: float = 30.0
    duration: float = float("inf")


def record(
    client: Client, server: str, path: Path, limits: Limits, report: Callable[[Progress], None], page: Path = FOLDER
) -> Progress:
    """Records a server until the duration is over, or until KeyboardInterrupt; both complete the file.

    Args:
        client: A connection to the server.
        server: The server's full name.
        path: The file, which must not exist.
        limits: What to record.
        report: Called about once a second.
        page: Folder of the built page.

    Raises:
        MjplugError: There is no page, the server does not answer, or the file cannot be written.
    """
    BuiltPage(page).require()
    key = names.key(server)
    # First, so that no file remains if the server does not answer.
    info, pack = _scene(client.session, key)
    with Recording(path, page, server, version("mjplug")) as recording:
        recorder = _Recorder(client.session, key, recording, limits)
        try:
            recorder.begin(info, pack)
            recorder.run(report)
        except KeyboardInterrupt:
            pass
        finally:
            recorder.close()
        recording.close()
        return recorder.progress


class _Recorder:
    """Takes the frames that Zenoh delivers, and writes those that are due."""

    def __init__(self, session: zenoh.Session, key: str, recording: Recording, limits: Limits) -> None:
        self._session = session
        self._key = key
        self._recording = recording
        self._limits = limits
        self._scenes: set[str] = set()
        self._frames = _Waiting()
        self._infos = _Waiting()
        self._first = self._last = 0.0
        self._due = 0.0
        self._state: object = None
        self._count = 0
        self._heard = monotonic()
        self._declared = [
            session.declare_subscriber(f"{key}/@view/{what}", Callback(waiting.put, indirect=False))
            for what, waiting in (("frame", self._frames), ("info", self._infos))
        ]

    @property
    def progress(self) -> Progress:
        silent = monotonic() - self._heard > _SILENCE
        return Progress(self._last - self._first, self._count, self._frames.lost, self._recording.size, silent)

    def begin(self, info: bytes, pack: bytes) -> None:
        """Writes the scene and the information."""
        hash = json.loads(info)["scene"]
        if hash not in self._scenes:
            self._scenes.add(hash)
            self._recording.add_scene(hash, pack)
        self._recording.set_info(time(), info)

    def run(self, report: Callable[[Progress], None]) -> None:
        end = monotonic() + self._limits.duration
        reported = monotonic()
        while (now := monotonic()) < end:
            frames = self._frames.take(min(_PROGRESS_PERIOD, end - now))
            if frames:
                if monotonic() - self._heard > _SILENCE:
                    # The server may have another model now.
                    self.begin(*_scene(self._session, self._key))
                self._heard = monotonic()
            for info in self._infos.take(0.0):
                if json.loads(info)["scene"] in self._scenes:
                    self._recording.set_info(time(), info)
                else:
                    self.begin(*_scene(self._session, self._key))
            for frame in frames:
                self._add(frame)
            if monotonic() - reported >= _PROGRESS_PERIOD:
                reported = monotonic()
                report(self.progress)

    def close(self) -> None:
        for declared in self._declared:
            # zenoh's stubs leave the return type open.
            declared.undeclare()  # type: ignore[no-untyped-call]

    def _add(self, frame: bytes) -> None:
        _, wall, epoch, _, flags = _FRAME.unpack_from(frame)
        # A reset and a pause are recorded at once, whatever the rate.
        if wall < self._due and (epoch, flags) == self._state:
            return
        self._state = epoch, flags
        # A frame that is a little early is not dropped, or frames at 60 Hz would be recorded at 20 Hz instead of 30 Hz.
        period = 1.0 / self._limits.rate
        self._due = max(self._due + period, wall + 0.5 * period)
        self._recording.add_frame(wall, frame)
        self._count += 1
        self._first = self._first or wall
        self._last = wall


class _Waiting:
    """Payloads between Zenoh's thread and the recorder.

    Attributes:
        lost: Number of payloads that were dropped.
    """

    def __init__(self) -> None:
        self.lost = 0
        self._payloads: deque[bytes] = deque()
        # Their difference is the size of the waiting payloads [bytes]; one is changed by `put`, the other by `take`.
        self._put = self._taken = 0
        # Only for Zenoh's threads. The recorder takes no lock, because Ctrl-C could leave it locked.
        self._putting = threading.Lock()
        self._arrived = Wakeup()

    def put(self, sample: zenoh.Sample) -> None:
        payload = bytes(sample.payload)
        with self._putting:
            self._payloads.append(payload)
            self._put += len(payload)
            while self._put - self._taken > MAX_WAITING and len(self._payloads) > 1:
                for oldest in self._pop():
                    self._put -= len(oldest)
                    self.lost += 1
        self._arrived.notify()

    def take(self, timeout: float) -> list[bytes]:
        """Waits for payloads and returns all."""
        self._arrived.wait_for(lambda: self._payloads, timeout)
        payloads = [payload for _ in range(len(self._payloads)) for payload in self._pop()]
        self._taken += sum(map(len, payloads))
        return payloads

    def _pop(self) -> list[bytes]:
        """Returns the oldest payload, or nothing if the other thread has taken it meanwhile."""
        try:
            return [self._payloads.popleft()]
        except IndexError:
            return []


def _scene(session: zenoh.Session, key: str) -> tuple[bytes, bytes]:
    """Returns the information about a server and its drawing pack.

    Raises:
        ClientError: The server does not send them.
    """
    info, pack = (bytes(query(session, f"{key}/@view/{part}", _TIMEOUT).payload) for part in ("info", "scene"))
    if hashlib.sha256(pack).hexdigest() != json.loads(info)["scene"]:
        raise ClientError(f"/{key} has just got another model; record again")
    return info, pack
