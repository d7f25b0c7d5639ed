"""Finds the servers and their current interfaces.

A server declares a liveliness token `@mjplug/<namespace>/<node_name>/<Zenoh id>`. Its queryable
`<namespace>/<node_name>/interfaces` returns its topics and services, and it publishes a message on the same key when
the list changes. Zenoh calls the callbacks on its own threads; this module passes the calls to the executor's thread.
"""

from collections.abc import Callable
from typing import Any

import zenoh
from zenoh.handlers import Callback

from mjplug_bridge_ros2.errors import ListingError
from mjplug_bridge_ros2.handover import Handover
from mjplug_bridge_ros2.listing import Entry, read_listing

_TOKENS = "@mjplug"

_LISTING_TIMEOUT = 5.0
"""Timeout of a query for the list [s]; after it, the query is repeated. A reply normally takes milliseconds."""


class Server:
    """One running server; queries its list of interfaces at the start and after each change.

    Args:
        session: The session for the queries.
        handover: Calls `listed` on the thread of the node.
        name: Full name of the server.
        zenoh_id: Id of its Zenoh session; it changes with every start of the server.
        listed: Called with each list.
        logger: Logger for errors.
    """

    def __init__(
        self,
        session: zenoh.Session,
        handover: Handover,
        name: str,
        zenoh_id: str,
        listed: Callable[[list[Entry]], None],
        logger: Any,
    ) -> None:
        self.name = name
        self.zenoh_id = zenoh_id
        self._session = session
        self._handover = handover
        self._listed = listed
        self._logger = logger
        self._key = f"{name[1:]}/interfaces"
        self._outdated = True
        self._querying = False
        self._closed = False
        self._changes: Any = session.declare_subscriber(
            self._key, Callback(self._change_received, drop=None, indirect=False)
        )
        self.refresh()

    def refresh(self) -> None:
        """Queries the list if it is outdated and no query is running."""
        if not self._outdated or self._querying or self._closed:
            return
        self._outdated, self._querying = False, True
        replies: list[bytes] = []

        def answered(reply: zenoh.Reply) -> None:
            if reply.ok is not None:
                replies.append(reply.ok.payload.to_bytes())

        def ended() -> None:
            self._handover.call(self._query_finished, replies)

        self._session.get(self._key, Callback(answered, drop=ended, indirect=False), timeout=_LISTING_TIMEOUT)

    def close(self) -> None:
        """Stops following the server."""
        self._closed = True
        self._changes.undeclare()

    def _change_received(self, sample: zenoh.Sample) -> None:
        self._handover.call(self._changed)

    def _changed(self) -> None:
        self._outdated = True
        self.refresh()

    def _query_finished(self, replies: list[bytes]) -> None:
        self._querying = False
        if self._closed:
            return
        if not replies:
            # The server has declared its token but not yet its queryable; `refresh` is called again soon.
            self._outdated = True
            return
        try:
            entries = read_listing(replies[0])
        except ListingError as error:
            self._logger.error(f"{self.name}: {error}; its mjplug version may differ from the bridge's")
            return
        self._listed(entries)
        self.refresh()


class Watch:
    """Follows the liveliness tokens of all servers.

    Args:
        session: The session for the subscription.
        handover: Calls `appeared` and `vanished` on the thread of the node.
        appeared: Called with name and Zenoh id of a server that starts.
        vanished: Called with name and Zenoh id of a server that stops or cannot be reached.
    """

    def __init__(
        self,
        session: zenoh.Session,
        handover: Handover,
        appeared: Callable[[str, str], None],
        vanished: Callable[[str, str], None],
    ) -> None:
        def report(sample: zenoh.Sample) -> None:
            name, _, zenoh_id = str(sample.key_expr)[len(_TOKENS) :].rpartition("/")
            callback = appeared if sample.kind == zenoh.SampleKind.PUT else vanished
            handover.call(callback, name, zenoh_id)

        self._subscriber: Any = session.liveliness().declare_subscriber(
            f"{_TOKENS}/**", Callback(report, drop=None, indirect=False), history=True
        )

    def close(self) -> None:
        """Stops following the servers."""
        self._subscriber.undeclare()
