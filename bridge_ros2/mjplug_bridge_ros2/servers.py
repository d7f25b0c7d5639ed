"""Which servers there are, and what each of them offers at the moment.

A server keeps a liveliness token `@mjplug/<namespace>/<node_name>/<Zenoh id>`; its queryable
`<namespace>/<node_name>/interfaces` lists its topics and services, and a message on the same key says that the list has
changed. Zenoh tells all this on its own threads; here it is handed to the executor, where everything else happens.
"""

from collections.abc import Callable
from typing import Any

import zenoh
from zenoh.handlers import Callback

from mjplug_bridge_ros2.errors import ListingError
from mjplug_bridge_ros2.handover import Handover
from mjplug_bridge_ros2.listing import Entry, read_listing

_TOKENS = "@mjplug"

_PATIENCE = 5.0
"""How long to wait for a list before asking again [s]; the answer comes within milliseconds."""


class Server:
    """One server that is there, whose list is asked for until it is known and whenever it has changed.

    Args:
        session: The session to ask with.
        handover: The way to the thread on which `listed` is called.
        name: The server's full name.
        zenoh_id: The id of its session, which is another one after a restart.
        listed: Called with each list.
        logger: Where to complain.
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
        self._stale = True
        self._asking = False
        self._gone = False
        self._changes: Any = session.declare_subscriber(self._key, Callback(self._heard, drop=None, indirect=False))
        self.refresh()

    def refresh(self) -> None:
        """Asks for the list, if it is not the newest one and nobody has asked already."""
        if not self._stale or self._asking or self._gone:
            return
        self._stale, self._asking = False, True
        replies: list[bytes] = []

        def answered(reply: zenoh.Reply) -> None:
            if reply.ok is not None:
                replies.append(reply.ok.payload.to_bytes())

        def ended() -> None:
            self._handover.call(self._answered, replies)

        self._session.get(self._key, Callback(answered, drop=ended, indirect=False), timeout=_PATIENCE)

    def close(self) -> None:
        """Forgets it."""
        self._gone = True
        self._changes.undeclare()

    def _heard(self, sample: zenoh.Sample) -> None:
        self._handover.call(self._changed)

    def _changed(self) -> None:
        self._stale = True
        self.refresh()

    def _answered(self, replies: list[bytes]) -> None:
        self._asking = False
        if self._gone:
            return
        if not replies:
            # It has its token already, but not yet its queryable; `refresh` is called again soon.
            self._stale = True
            return
        try:
            entries = read_listing(replies[0])
        except ListingError as error:
            self._logger.error(f"{self.name}: {error}; is it another version of mjplug?")
            return
        self._listed(entries)
        self.refresh()


class Watch:
    """Follows the tokens of all servers.

    Args:
        session: The session to listen with.
        handover: The way to the thread on which `appeared` and `vanished` are called.
        appeared: Called with the name and the Zenoh id of a server.
        vanished: The same.
    """

    def __init__(
        self,
        session: zenoh.Session,
        handover: Handover,
        appeared: Callable[[str, str], None],
        vanished: Callable[[str, str], None],
    ) -> None:
        def tell(sample: zenoh.Sample) -> None:
            name, _, zenoh_id = str(sample.key_expr)[len(_TOKENS) :].rpartition("/")
            report = appeared if sample.kind == zenoh.SampleKind.PUT else vanished
            handover.call(report, name, zenoh_id)

        self._subscriber: Any = session.liveliness().declare_subscriber(
            f"{_TOKENS}/**", Callback(tell, drop=None, indirect=False), history=True
        )

    def close(self) -> None:
        """Stops."""
        self._subscriber.undeclare()
