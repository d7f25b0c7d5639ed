"""The frames and overlays that one page gets."""

from mjplug.client.errors import ClientError
from mjplug.view.network import Network
from mjplug.view.outbox import FRAME, OVERLAY, NewestSlot, Outbox
from mjplug.view.remote_server import Server
from mjplug.view.values import shown
from mjplug.view.watching import OVERLAYS, Stream, Watched, Watcher


class Streams:
    """The servers that one page watches, with their overlays.

    Args:
        network: The network.
        outbox: The outbox of the page.
        watcher: Gets the descriptions of the servers.
    """

    def __init__(self, network: Network, outbox: Outbox, watcher: Watcher) -> None:
        self._network = network
        self._outbox = outbox
        self._watcher = watcher
        self._watched: dict[int, Watched] = {}
        # By server, kind of item and channel.
        self._open: dict[tuple[int, int, int], tuple[str, Stream, NewestSlot]] = {}
        self._suspended = False

    def watch(self, id: object, on: bool) -> None:
        """Starts or stops the frames and descriptions of a server.

        Raises:
            ClientError: There is no server with this id.
        """
        server = self._network.servers.by_id(id)
        if not self._switch(server, "frame", FRAME, 0, on):
            return
        if on:
            watched = self._watched[server.id] = self._network.watched(server)
            watched.add(self._watcher)
        else:
            self._watched.pop(server.id).remove(self._watcher)

    def overlay(self, id: object, kind: object, on: bool) -> None:
        """Starts or stops an overlay of a server.

        Raises:
            ClientError: There is no server with this id, or no such kind of overlay.
        """
        server = self._network.servers.by_id(id)
        if not isinstance(kind, str) or kind not in OVERLAYS:
            raise ClientError(f"kind is {shown(kind)}; it must be one of: {', '.join(OVERLAYS)}")
        self._switch(server, f"overlay/{kind}", OVERLAY, OVERLAYS.index(kind), on)

    def suspend(self) -> None:
        """Ends the Zenoh subscriptions until `resume`."""
        self._suspended = True
        for key, stream, _ in self._open.values():
            self._network.feeds.remove(key, stream)

    def resume(self) -> None:
        """Subscribes again."""
        self._suspended = False
        for key, stream, _ in self._open.values():
            self._network.feeds.add(key, stream)

    def close(self) -> None:
        """Ends all subscriptions."""
        if not self._suspended:
            self.suspend()
        self._open.clear()
        for watched in self._watched.values():
            watched.remove(self._watcher)
        self._watched.clear()

    def _switch(self, server: Server, name: str, kind: int, channel: int, on: bool) -> bool:
        """Starts or stops a stream; returns whether that changes anything."""
        place = server.id, kind, channel
        if on == (place in self._open):
            return False
        if on:
            slot = NewestSlot(kind, server.id, channel)

            def deliver(payload: bytes) -> None:
                slot.put(payload)
                self._outbox.fill(slot)

            key, stream = f"{server.key}/@view/{name}", Stream(self._network.watched(server), deliver)
            self._open[place] = key, stream, slot
            if not self._suspended:
                self._network.feeds.add(key, stream)
        else:
            key, stream, slot = self._open.pop(place)
            if not self._suspended:
                self._network.feeds.remove(key, stream)
            self._outbox.discard(slot)
        return True
