"""The drawing packs of servers, by their hashes."""

import asyncio
import hashlib
import logging
from collections import OrderedDict

import zenoh

from mjplug.client.errors import ClientError, TimedOutError
from mjplug.view.queries import ask

_log = logging.getLogger(__name__)

MAX_BYTES = 128 << 20
"""Maximum total size of the packs that are kept [bytes]; the newest one is kept at any size."""

TIMEOUT = 120.0
"""Timeout of a query [s]: making the pack of a large model takes seconds, and the link may be slow."""

_RETRY = 1.0
"""Pause before a query is repeated that was not answered [s]."""

_GIVE_UP_AFTER = 150.0
"""A query is not repeated after this time [s]: a server that is busy or was lost for a while may still answer."""


class Scenes:
    """Fetches each pack once, and keeps the last ones.

    Args:
        session: The session.
    """

    def __init__(self, session: zenoh.Session) -> None:
        self._session = session
        self._servers: dict[str, str] = {}
        self._packs: OrderedDict[str, bytes] = OrderedDict()
        self._fetching: dict[str, asyncio.Task[bytes]] = {}

    def announce(self, hash: str, server_key: str) -> None:
        """Notes which server has the pack with a hash, and begins to fetch it."""
        self._servers[hash] = server_key
        if hash not in self._packs:
            self._task(hash)

    async def get(self, hash: str) -> bytes:
        """Returns a pack, compressed with gzip.

        Raises:
            ClientError: No server has it, or the server does not send it.
        """
        pack = self._packs.get(hash)
        if pack is not None:
            self._packs.move_to_end(hash)
            return pack
        if hash not in self._servers:
            raise ClientError(f"no server has the scene {hash!r}")
        # The task goes on if this request is cancelled, because others may wait for it.
        return await asyncio.shield(self._task(hash))

    def close(self) -> None:
        """Cancels queries."""
        for task in self._fetching.values():
            task.cancel()

    def _task(self, hash: str) -> "asyncio.Task[bytes]":
        task = self._fetching.get(hash)
        if task is None:
            task = self._fetching[hash] = asyncio.create_task(self._fetch(hash))
            task.add_done_callback(lambda done: self._fetched(hash, done))
        return task

    async def _fetch(self, hash: str) -> bytes:
        pack = await self._query(hash)
        actual = await asyncio.to_thread(lambda: hashlib.sha256(pack).hexdigest())
        if actual != hash:
            raise ClientError(f"the server has another scene now: {actual}, not {hash}")
        return pack

    async def _query(self, hash: str) -> bytes:
        clock = asyncio.get_running_loop().time
        began = clock()
        while True:
            try:
                return await ask(self._session, f"{self._servers[hash]}/@view/scene", TIMEOUT)
            except TimedOutError as error:
                if clock() - began >= _GIVE_UP_AFTER:
                    raise
                _log.info("asking again for the scene: %s", error)
            await asyncio.sleep(_RETRY)

    def _fetched(self, hash: str, task: "asyncio.Task[bytes]") -> None:
        del self._fetching[hash]
        if task.cancelled():
            return
        if (error := task.exception()) is not None:
            _log.warning("the scene of %s cannot be fetched: %s", self._servers[hash], error)
            return
        self._packs[hash] = task.result()
        while len(self._packs) > 1 and sum(map(len, self._packs.values())) > MAX_BYTES:
            self._packs.popitem(last=False)
