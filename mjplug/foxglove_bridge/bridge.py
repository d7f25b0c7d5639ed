"""The WebSocket server for Foxglove, fed over Zenoh."""

import threading

import foxglove
import zenoh
from foxglove.websocket import Capability, StatusLevel

from mjplug.client import Client
from mjplug.errors import MjplugError
from mjplug.foxglove_bridge.listener import Listener
from mjplug.foxglove_bridge.services import service_of
from mjplug.foxglove_bridge.topics import Topics
from mjplug.recorder.recorder import CLOCK
from mjplug.recorder.sources import ServiceSource, Source, Sources
from mjplug_schemas.names import key


class FoxgloveBridge:
    """Serves the topics, services and parameters of a network.

    Attributes:
        sources: The topics and services of the network.

    Args:
        client: The client of the network; the caller closes it afterwards.
        host: Address to listen on.
        port: Port to listen on; 0 means any free port.
        read_only: Whether clients can neither publish, call services nor set parameters.

    Raises:
        MjplugError: The port is in use.
    """

    def __init__(self, client: Client, host: str, port: int, read_only: bool) -> None:
        self._client = client
        self._read_only = read_only
        self._offered: set[str] = set()
        self._clocks: dict[str, object] = {}
        # The SDK refuses a call on the server while another thread is in one ("Already mutably borrowed").
        self._calling = threading.Lock()
        context = foxglove.Context()
        self._topics = Topics(client.session, context, self._jump)
        writing = [] if read_only else [Capability.ClientPublish, Capability.Services, Capability.Parameters]
        try:
            self._server = foxglove.start_server(
                name="mjplug",
                host=host,
                port=port,
                capabilities=[Capability.Time, *writing],
                # A client may connect before there are sources.
                server_listener=Listener(client, self._topics, lambda: self.sources.servers, self._show),
                supported_encodings=[] if read_only else ["cdr", "json"],
                context=context,
            )
        except Exception as error:
            # The SDK raises errors of its own and RuntimeError.
            raise MjplugError(f"cannot listen on {host}:{port}: {error}; choose another port with --port") from error
        self.sources = Sources(client.session, self._found, None if read_only else self._serve)

    @property
    def port(self) -> int:
        """The port on which it listens."""
        with self._calling:
            return self._server.port

    def close(self) -> None:
        """Ends the server."""
        self.sources.close()
        for clock in self._clocks.values():
            clock.undeclare()  # type: ignore[attr-defined]
        self._server.stop()
        self._topics.close()

    def _found(self, source: Source) -> None:
        self._topics.add(source)
        if source.topic.type == CLOCK and source.published and source.topic.name not in self._clocks:
            # Also without a subscriber in Foxglove, because all panels use this time.
            self._clocks[source.topic.name] = self._client.session.declare_subscriber(
                key(source.topic.name),
                self._tick,
            )

    def _serve(self, source: ServiceSource) -> None:
        if source.name in self._offered:
            return
        self._offered.add(source.name)
        service = service_of(self._client.session, source)
        with self._calling:
            self._server.add_services([service])

    def _tick(self, sample: zenoh.Sample) -> None:
        time_ns = max(0, self._topics.time_of(sample))
        with self._calling:
            self._server.broadcast_time(time_ns)

    def _jump(self) -> None:
        with self._calling:
            self._server.clear_session()

    def _show(self, text: str) -> None:
        with self._calling:
            self._server.publish_status(text, StatusLevel.Warning)
