"""A request of a ROS 2 node."""

from collections.abc import Mapping

import zenoh

from mjplug.wire.encoding import TEXT, Form, Received
from mjplug.wire.rmw_zenoh.attachment import Attachment


class RmwRequest:
    """A query of a ROS 2 client. Implements `mjplug.wire.dialect.RawRequest`.

    A node only logs an error reply and keeps waiting, so a response is always needed.

    Args:
        query: The query.
        key: The key of the response.
        attachment: The attachment of the request.
        mismatch: Why the request cannot be decoded, if its key shows another definition; otherwise empty.
    """

    needs_response = True

    def __init__(self, query: zenoh.Query, key: str, attachment: Attachment, mismatch: str = "") -> None:
        self.received = Received(query.payload, None, "cdr", mismatch)
        self.size = len(query.payload) if query.payload is not None else 0
        self.parameters: Mapping[str, str] = {}
        self._query = query
        self._key = key
        self._attachment = attachment

    def reply(self, payload: bytes, form: Form) -> None:
        """Sends the response."""
        with self._query as query:
            query.reply(self._key, payload, attachment=self._attachment.of_response().to_bytes())

    def reply_error(self, sentence: str) -> None:
        """Sends an error reply with one sentence, which the node logs."""
        with self._query as query:
            query.reply_err(sentence.encode(), encoding=TEXT)
