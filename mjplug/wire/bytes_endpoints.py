"""Endpoints for bytes that are no ROS message, such as the frames of the simulation view."""

import threading
from collections.abc import Callable
from dataclasses import dataclass

import zenoh

from mjplug.contracts.transport import DEFAULT, BytesQuery
from mjplug.wire.callbacks import callback
from mjplug.wire.dialect import RemoteWriterSpec
from mjplug.wire.encoding import TEXT
from mjplug.wire.key_writers import LiveWriter
from mjplug.wire.origin import Now, no_time
from mjplug.wire.rejections import Rejections
from mjplug.wire.replies import Replies

MAX_OPEN_QUERIES = 64
"""Maximum number of queries that wait for their reply at the same time."""


class WireBytesPublisher:
    """Implements `mjplug.contracts.transport.BytesPublisher`.

    Attributes:
        writers: The one writer of the key.

    Args:
        writer: The writer of the key.
    """

    def __init__(self, writer: LiveWriter) -> None:
        self.writers = (writer,)
        self._writer = writer

    @property
    def matched(self) -> bool:
        """Whether the key has a subscriber."""
        return self._writer.matched

    def put(self, payload: bytes) -> None:
        """Publishes the bytes."""
        self._writer.put(zenoh.ZBytes(payload))

    def remote_spec(self) -> "RemoteBytesSpec":
        """Returns the data with which a worker process can publish on the key in place of the server."""
        return RemoteBytesSpec(self._writer.remote_spec())


@dataclass(frozen=True, slots=True)
class RemoteBytesSpec:
    """The data with which a worker process publishes on a key in place of the server. Picklable."""

    writer: RemoteWriterSpec

    def open(self, session: zenoh.Session, on_matched: Callable[[], None], now: Now = no_time) -> WireBytesPublisher:
        """Declares the publisher on another session; `on_matched` is called when it gets its first subscriber."""
        writer = self.writer.open(session, on_matched, now)
        assert isinstance(writer, LiveWriter)
        return WireBytesPublisher(writer)


class BytesEndpoints:
    """Declares endpoints for bytes on one session.

    Replies are sent on a thread of their own: a large reply over a slow link must not delay the responses of services.
    """

    def __init__(self, session: zenoh.Session) -> None:
        self._session = session
        self._writers: list[LiveWriter] = []
        self._declared: list[object] = []
        self._replies: Replies | None = None
        self._open = threading.BoundedSemaphore(MAX_OPEN_QUERIES)

    def open_publisher(self, key: str, encoding: str, on_matched: Callable[[], None]) -> WireBytesPublisher:
        """Declares a publisher."""
        writer = LiveWriter(self._session, key, "bytes", zenoh.Encoding(encoding), DEFAULT, on_matched)
        self._writers.append(writer)
        return WireBytesPublisher(writer)

    def open_subscription(self, key: str, limit: int, deliver: Callable[[bytes], None]) -> None:
        """Declares a subscription; payloads above `limit` bytes are dropped and logged."""
        rejections = Rejections(f"key {key}: a payload was refused")

        def receive(sample: zenoh.Sample) -> None:
            size = len(sample.payload)
            if size > limit:
                rejections.add(f"it has {size} bytes; at most {limit} are accepted")
            elif sample.kind == zenoh.SampleKind.PUT:
                deliver(bytes(sample.payload))

        self._declared.append(self._session.declare_subscriber(key, callback(receive)))

    def open_queryable(self, key: str, deliver: Callable[[BytesQuery], None]) -> None:
        """Declares a queryable."""
        replies = self._replies = self._replies or Replies()

        def receive(query: zenoh.Query) -> None:
            if str(query.key_expr) != key:
                with query:
                    query.reply_err(f"query exactly {key}".encode(), encoding=TEXT)
            elif self._open.acquire(blocking=False):
                deliver(_WireBytesQuery(query, key, replies, self._open))
            else:
                with query:
                    query.reply_err(
                        f"busy: {MAX_OPEN_QUERIES} queries are waiting, which is the maximum; try again later".encode(),
                        encoding=TEXT,
                    )

        self._declared.append(self._session.declare_queryable(key, callback(receive), complete=False))

    def watch_leaving(self, keys: str, left: Callable[[str], None]) -> None:
        """Calls `left` with the key of each liveliness token that disappears."""

        def changed(sample: zenoh.Sample) -> None:
            if sample.kind == zenoh.SampleKind.DELETE:
                left(str(sample.key_expr))

        self._declared.append(self._session.liveliness().declare_subscriber(keys, callback(changed)))

    def watch_tokens(self, keys: str, changed: Callable[[str, bool], None]) -> None:
        """Calls `changed` with the key of each liveliness token that appears or disappears, and with existing ones."""

        def report(sample: zenoh.Sample) -> None:
            changed(str(sample.key_expr), sample.kind == zenoh.SampleKind.PUT)

        self._declared.append(self._session.liveliness().declare_subscriber(keys, callback(report), history=True))

    def close(self) -> None:
        """Makes publishers unmatched and waits until the replies are sent; the session undeclares the rest."""
        for writer in self._writers:
            writer.close()
        if self._replies is not None:
            self._replies.close()


class _WireBytesQuery:
    """Implements `mjplug.contracts.transport.BytesQuery`."""

    def __init__(self, query: zenoh.Query, key: str, replies: Replies, open: threading.BoundedSemaphore) -> None:
        # The answering thread takes the query out; list.pop succeeds in one thread only.
        self._query = [query]
        self._key = key
        self._replies = replies
        self._open = open

    def reply(self, payload: bytes, encoding: str, attachment: str = "") -> None:
        """Replies with bytes."""

        def send(query: zenoh.Query) -> None:
            query.reply(self._key, payload, encoding=zenoh.Encoding(encoding), attachment=attachment.encode() or None)

        self._answer(send)

    def refuse(self, reason: str) -> None:
        """Sends an error reply with one sentence."""
        self._answer(lambda query: query.reply_err(reason.encode(), encoding=TEXT))

    def _answer(self, answer: Callable[[zenoh.Query], None]) -> None:
        try:
            query = self._query.pop()
        except IndexError:
            return

        def send() -> None:
            try:
                with query:
                    answer(query)
            finally:
                self._open.release()

        self._replies.post(send)
