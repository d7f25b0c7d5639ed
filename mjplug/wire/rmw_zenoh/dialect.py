"""Maps topics and services to Zenoh as rmw_zenoh does, so that ROS 2 nodes connect without a bridge.

Everything is declared first and its liveliness token afterwards, so that an announced topic or service already works.
"""

from collections.abc import Callable, Mapping
from itertools import count
from typing import Any

import zenoh

from mjplug.contracts.actions import ActionName
from mjplug.contracts.transport import QoS, ServiceName, Topic
from mjplug.wire.callbacks import callback
from mjplug.wire.dialect import KeyWriter, RawGoal, RawRequest
from mjplug.wire.encoding import TEXT, Received
from mjplug.wire.key_subscriber import declare_key_subscriber
from mjplug.wire.refusal import refusal
from mjplug.wire.rejections import Rejections
from mjplug.wire.rmw_zenoh.attachment import Attachment
from mjplug.wire.rmw_zenoh.key_writers import LatchedRmwWriter, LiveRmwWriter
from mjplug.wire.rmw_zenoh.keys import RosSettings, definition_mismatch
from mjplug.wire.rmw_zenoh.mismatches import Mismatches
from mjplug.wire.rmw_zenoh.older import OlderRequest, older_definition
from mjplug.wire.rmw_zenoh.qos import PARAMETER_SERVICE, SERVICE, qos_chunk
from mjplug.wire.rmw_zenoh.raw_request import RmwRequest
from mjplug.wire.rmw_zenoh.tokens import EndpointKind, Node, gid
from mjplug_schemas.message import Service
from mjplug_schemas.registry import Interface


class RmwZenohDialect:
    """Implements `mjplug.wire.dialect.Dialect` on one session, as one ROS 2 node.

    Attributes:
        types: The types of all topics, services and actions, by type name.

    Args:
        session: The session.
        name: The node's full name, such as `/robot1/mjplug`.
        settings: The domain and the distribution.
    """

    def __init__(self, session: zenoh.Session, name: str, settings: RosSettings) -> None:
        self.types: dict[str, Interface] = {}
        self._session = session
        self._settings = settings
        self._ids = count()
        namespace, _, node = name.rpartition("/")
        self._node = Node(settings.domain_id, str(session.zid()), next(self._ids), namespace, node)
        self._mismatches = Mismatches(session, settings.domain_id, name)
        self._writers: list[LiveRmwWriter | LatchedRmwWriter] = []
        self._declared: list[object] = []
        self._unreadable: dict[str, Rejections] = {}
        self._tokens = [session.liveliness().declare_token(self._node.token)]

    def topic_keys(self, topic: Topic[Any]) -> Mapping[str, str]:
        """Returns the data key by its field name in the list of interfaces."""
        return {"ros2_key": self._settings.data_key(topic.name, topic.type)}

    def service_keys(self, service: ServiceName) -> Mapping[str, str]:
        """Returns the data key by its field name in the list of interfaces."""
        return {"ros2_key": self._settings.data_key(service.name, self._announced(service.type))}

    def declare_writers(self, topic: Topic[Any], on_matched: Callable[[], None]) -> list[KeyWriter]:
        """Declares and announces the publisher of a topic."""
        key = self._settings.data_key(topic.name, topic.type)
        token = self._token("MP", topic.name, topic.type, topic.qos)
        writer: LiveRmwWriter | LatchedRmwWriter
        if topic.qos.durability == "transient_local":
            writer = LatchedRmwWriter(self._session, key, gid(token), topic.qos)
        else:
            writer = LiveRmwWriter(self._session, key, gid(token), topic.qos, on_matched)
        self._writers.append(writer)
        self._announce(token, "MP", topic.name, topic.type)
        return [writer]

    def declare_subscribers(self, topic: Topic[Any], receive: Callable[[Received], None]) -> None:
        """Declares and announces the subscription of a topic."""

        def handle(sample: zenoh.Sample) -> None:
            if sample.kind == zenoh.SampleKind.PUT:
                # Nodes do not set the encoding and ignore it, so it is not used.
                mismatch = definition_mismatch(str(sample.key_expr), topic.type)
                receive(Received(sample.payload, None, "cdr", mismatch))

        key, handler = self._settings.any_hash_key(topic.name, topic.type), callback(handle)
        self._declared.append(declare_key_subscriber(self._session, key, handler, topic.qos))
        # Without this token, publishers of Lyrical and later do not publish large messages on this key.
        self._announce(self._token("MS", topic.name, topic.type, topic.qos), "MS", topic.name, topic.type)

    def declare_service(self, service: ServiceName, receive: Callable[[RawRequest], None]) -> None:
        """Declares and announces a service."""
        qos = PARAMETER_SERVICE if service.type.TYPE.startswith("rcl_interfaces/") else SERVICE
        older, distro = older_definition(service.type), self._settings.distro
        # Graph tools show the hash, so it is that of the distribution's definition; requests may have either.
        announced = self._announced(service.type)
        any_key = self._settings.any_hash_key(service.name, service.type)
        own_key = self._settings.data_key(service.name, announced)
        unreadable = Rejections(f"service {service.name}: a query was not a request of a ROS 2 node")
        self._unreadable[service.name] = unreadable

        def handle(query: zenoh.Query) -> None:
            key = str(query.key_expr)
            if key == any_key:
                key = own_key
            if "*" in key:
                # A query with a wildcard or without an attachment is not from a ROS 2 node, so an error reply is right.
                reply_error(query, f"{own_key} is a service; query exactly this key to call it")
                return
            raw = bytes(query.attachment) if query.attachment is not None else b""
            try:
                attachment = Attachment.from_bytes(raw)
            except ValueError as error:
                unreadable.add(str(error))
                if raw:
                    refuse(query, key, raw, str(error))
                else:
                    reply_error(query, str(error))
            else:
                if older is not None and older.applies(key, distro):
                    receive(OlderRequest(RmwRequest(query, key, attachment), older))
                else:
                    receive(RmwRequest(query, key, attachment, definition_mismatch(key, service.type)))

        def refuse(query: zenoh.Query, key: str, attachment: bytes, sentence: str) -> None:
            # A node with another version of rmw_zenoh would wait for ever after an error reply. Its own attachment
            # identifies its request.
            response = refusal(service.type.Response, sentence) or service.type.Response()
            with query:
                query.reply(key, response.to_cdr(), attachment=attachment)

        def reply_error(query: zenoh.Query, sentence: str) -> None:
            with query:
                query.reply_err(sentence.encode(), encoding=TEXT)

        # Declared complete, because clients of rmw_zenoh query only complete queryables.
        self._declared.append(self._session.declare_queryable(any_key, callback(handle), complete=True))
        self._announce(self._token("SS", service.name, announced, qos), "SS", service.name, announced)

    def action_keys(self, action: ActionName) -> Mapping[str, str]:
        """Returns an empty mapping: in ROS, an action is its three services and two topics."""
        return {}

    def declare_action(self, action: ActionName, receive: Callable[[RawGoal], None]) -> None:
        """Records the type for type descriptions; there is no key for the action itself."""
        self.types[action.type.TYPE] = action.type

    def refused(self) -> Mapping[str, int]:
        """Returns the number of queries that were not requests of a ROS 2 node, by the name of the service."""
        return {name: rejections.count for name, rejections in self._unreadable.items()}

    def close(self) -> None:
        """Makes every writer unmatched permanently, and removes the endpoints, then the node, from the ROS graph."""
        for writer in self._writers:
            writer.close()
        while self._tokens:
            # zenoh's stubs leave the return type open.
            self._tokens.pop().undeclare()  # type: ignore[no-untyped-call]

    def _announced(self, service: type[Service]) -> type[Service]:
        """Returns the definition of a service in the distribution."""
        older = older_definition(service)
        return older.old if older is not None and older.is_announced(self._settings.distro) else service

    def _token(self, kind: EndpointKind, name: str, interface: Any, qos: QoS) -> str:
        self.types[interface.TYPE] = interface
        return self._node.endpoint_token(
            next(self._ids), kind, name, interface.TYPE, self._settings.type_hash(interface), qos_chunk(qos)
        )

    def _announce(self, token: str, kind: EndpointKind, name: str, interface: Any) -> None:
        self._tokens.append(self._session.liveliness().declare_token(token))
        self._mismatches.watch(kind, name, interface.TYPE, self._settings.type_hash(interface))
