"""Whether access rules let this client command a server: Zenoh drops what they forbid, without an answer."""

import asyncio

import zenoh

from mjplug.client.errors import ClientError
from mjplug.view.queries import NoReplyError, ask
from mjplug.view.remote_server import Server
from mjplug.wire.encoding import encoding_of
from mjplug_schemas.rcl_interfaces import SetParameters

_TIMEOUT = 2.0
"""Timeout of the query [s]; without an answer in time, the client counts as permitted."""

_ASK_AGAIN = 5.0
"""Time after which a refusal is checked again [s]: a server that is starting does not answer either."""


class Permissions:
    """Finds out for each server, with a request that sets no parameters: a command that changes nothing.

    Args:
        session: The session.
    """

    def __init__(self, session: zenoh.Session) -> None:
        self._session = session
        self._asked: dict[str, asyncio.Task[bool]] = {}

    async def require(self, server: Server) -> None:
        """Raises an error if this client may not command a server.

        Raises:
            ClientError: The access rules of the server forbid it.
        """
        task = self._asked.get(server.key)
        if task is None:
            task = self._asked[server.key] = asyncio.create_task(self._permitted(server))
        # Other pages may wait for it too.
        if not (task.result() if task.done() else await asyncio.shield(task)):
            raise ClientError(
                f"{server.name} permits this view only to look: its access rules give the client of `mjplug view` the "
                "role of a viewer; use the key of an operator (--zenoh-config)"
            )

    def forget(self, server: Server) -> None:
        """Asks again at the next need, for example because the server has been replaced."""
        # The query goes on, because a page may wait for it.
        self._asked.pop(server.key, None)

    def close(self) -> None:
        """Cancels queries."""
        for task in self._asked.values():
            task.cancel()

    async def _permitted(self, server: Server) -> bool:
        request = SetParameters.Request(parameters=())
        encoding = encoding_of("cdr", SetParameters.Request)
        try:
            await ask(self._session, f"{server.key}/set_parameters", _TIMEOUT, bytes(request.to_cdr()), encoding)
        except NoReplyError:
            asyncio.get_running_loop().call_later(_ASK_AGAIN, self.forget, server)
            return False
        except ClientError:
            # It answers, or it is too busy to answer in time.
            return True
        return True
