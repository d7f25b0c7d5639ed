"""What clients of the WebSocket do: subscribe, publish, and read and set parameters."""

from collections.abc import Callable
from typing import Any

import foxglove
import zenoh
from foxglove.websocket import ChannelView, Client, ClientChannel, ServerListener

from mjplug.client import Client as MjplugClient
from mjplug.client import ClientError
from mjplug.client.parameters import names_of, scalar, set_values
from mjplug.errors import MjplugError
from mjplug.foxglove_bridge.topics import Topics
from mjplug.wire.origin import Attachments, host_id, no_time
from mjplug_schemas.errors import NameRuleError
from mjplug_schemas.names import key, validate_name
from mjplug_schemas.rcl_interfaces import GetParameters, ParameterType

_MAX_PAYLOAD = 1 << 20
"""Maximum size of a message from a client of the WebSocket [bytes], as for the server."""


class Listener(ServerListener):
    """Handles the messages of clients. The SDK calls it on its own threads.

    Args:
        client: The client of the network.
        topics: The topics.
        servers: Returns the names of the servers.
        status: Shows a sentence to the users.
    """

    def __init__(
        self,
        client: MjplugClient,
        topics: Topics,
        servers: Callable[[], list[str]],
        status: Callable[[str], None],
    ) -> None:
        self._client = client
        self._servers = servers
        self._topics = topics
        self._status = status
        self._published: dict[tuple[int, int], tuple[zenoh.Publisher, Attachments]] = {}

    def on_subscribe(self, client: Client, channel: ChannelView) -> None:
        """Subscribes."""
        self._topics.subscribe(client.id, channel.id)

    def on_unsubscribe(self, client: Client, channel: ChannelView) -> None:
        """Ends a subscription."""
        self._topics.unsubscribe(client.id, channel.id)

    def on_client_advertise(self, client: Client, channel: ClientChannel) -> None:
        """Declares a publisher of a client."""
        try:
            validate_name(channel.topic)
        except NameRuleError as error:
            self._status(str(error))
            return
        type = channel.schema_name.replace("/", "/msg/") if channel.schema_name.count("/") == 1 else channel.schema_name
        encoding = zenoh.Encoding.APPLICATION_JSON
        if channel.encoding == "cdr":
            encoding = zenoh.Encoding.APPLICATION_CDR.with_schema(type[:255])
        publisher = self._client.session.declare_publisher(
            key(channel.topic), encoding=encoding, congestion_control=zenoh.CongestionControl.BLOCK
        )
        attachments = Attachments(host_id(self._client.session, "foxglove"), no_time)
        self._published[client.id, channel.id] = publisher, attachments

    def on_client_unadvertise(self, client: Client, client_channel_id: int) -> None:
        """Ends a publisher of a client."""
        found = self._published.pop((client.id, client_channel_id), None)
        if found is not None:
            # zenoh's stubs leave the return type open.
            found[0].undeclare()  # type: ignore[no-untyped-call]

    def on_message_data(self, client: Client, client_channel_id: int, data: bytes) -> None:
        """Publishes a message of a client."""
        found = self._published.get((client.id, client_channel_id))
        if found is None or len(data) > _MAX_PAYLOAD:
            return
        publisher, attachments = found
        publisher.put(data, attachment=attachments.next())

    def on_get_parameters(
        self, client: Client, param_names: list[str], request_id: str | None = None
    ) -> list[foxglove.Parameter]:
        """Returns parameters; all if no names are given. A name is `<server>.<parameter>`."""
        try:
            return self._parameters(frozenset(param_names))
        except MjplugError as error:
            self._status(str(error))
            return []

    def on_set_parameters(
        self, client: Client, parameters: list[foxglove.Parameter], request_id: str | None = None
    ) -> list[foxglove.Parameter]:
        """Sets parameters, and returns their values after that."""
        for parameter in parameters:
            server, name = _split(parameter.name)
            try:
                for result in set_values(self._client, server, {name: parameter.get_value()}):
                    if not result.successful:
                        self._status(f"{parameter.name}: {result.reason}")
            except MjplugError as error:
                self._status(f"{parameter.name}: {error}")
        return self.on_get_parameters(client, [parameter.name for parameter in parameters])

    def _parameters(self, names: frozenset[str]) -> list[foxglove.Parameter]:
        found = []
        for server in self._servers():
            try:
                own = [name for name in names_of(self._client, server) if not names or f"{server}.{name}" in names]
                request = GetParameters.Request(names=tuple(own))
                values = self._client.call(f"{server}/get_parameters", request).values if own else ()
            except ClientError as error:
                self._status(f"the parameters of {server} are missing: {error}")
                continue
            for name, value in zip(own, values, strict=True):
                # A parameter that is not set has no value to show.
                if value.type != ParameterType.PARAMETER_NOT_SET:
                    found.append(foxglove.Parameter(f"{server}.{name}", value=_plain(scalar(value))))
        return found


def _split(name: str) -> tuple[str, str]:
    server, _, parameter = name.partition(".")
    return server, parameter


def _plain(value: Any) -> Any:
    return list(value) if isinstance(value, tuple) else value
