"""A transport that takes bytes from an attacker in place of a network, with the server's own decoders."""

import zenoh
from hostile.inputs import Interface, encoding_of

from mjplug.contracts.actions import ActionPublishers
from mjplug.wire.actions import GoalReceiver
from mjplug.wire.calls import OpenCalls
from mjplug.wire.encoding import Received
from mjplug.wire.service import ServiceServer
from mjplug.wire.subscription import Subscription


class ByteTransport:
    """Implements `mjplug.contracts.transport.Transport` with the server's own decoders, and bytes from the attacker."""

    def __init__(self):
        self.open_calls = OpenCalls()
        self.doors, self.inlets, self.interfaces = {}, {}, []
        self.bytes_subscriptions = {}
        self.published = 0

    def open_publisher(self, topic, on_matched=None):
        self.interfaces.append(Interface("published", topic.name[1:], topic.name[1:], topic.type.TYPE, topic.type))
        return EncodingPublisher(self)

    def open_subscription(self, topic, deliver):
        self.interfaces.append(Interface("subscribed", topic.name[1:], topic.name[1:], topic.type.TYPE, topic.type))
        self.inlets.setdefault(topic.name[1:], []).append(Subscription(topic, deliver))

    def open_service(self, service, deliver):
        key = service.name[1:]
        self.interfaces.append(Interface("service", key, key, service.type.TYPE, service.type.Request))
        self.doors[key] = ServiceServer(service, deliver, self.open_calls)

    def open_action(self, action, callbacks):
        callbacks_of = (callbacks.send_goal, callbacks.cancel_goal, callbacks.get_result)
        for service, deliver in zip(action.services, callbacks_of, strict=True):
            self.open_service(service, deliver)
        key = action.name[1:]
        self.interfaces.append(Interface("service", key, key, action.type.TYPE, action.type.Goal))
        self.doors[key] = GoalReceiver(action, callbacks.query, self.open_calls)
        return ActionPublishers(*(self.open_publisher(topic) for topic in action.topics))

    def open_bytes_publisher(self, key, encoding, on_matched):
        return EncodingPublisher(self)

    def open_bytes_subscription(self, key, limit, deliver):
        self.bytes_subscriptions[key] = limit, deliver

    def open_bytes_queryable(self, key, deliver):
        pass

    def watch_tokens(self, keys, changed):
        pass

    def watch_leaving(self, keys, left):
        pass


class EncodingPublisher:
    """Encodes published messages as CDR and JSON, without a network."""

    matched = True

    def __init__(self, transport):
        self._transport = transport

    def publish(self, message):
        message.to_cdr()
        message.to_json()
        self._transport.published += 1

    def publish_frame(self, frame):
        frame.payload()
        self._transport.published += 1


class LocalInquiry:
    """One request; implements `mjplug.wire.dialect.RawGoal`, and so `RawRequest`."""

    def __init__(self, given, needs_response):
        payload = None if given.payload is None else zenoh.ZBytes(given.payload)
        only = "cdr" if needs_response else None
        self.received = Received(payload, None if needs_response else encoding_of(given.encoding), only)
        self.parameters = dict(pair.partition("=")[::2] for pair in given.parameters.split(";") if pair)
        self.needs_response = needs_response
        self.size = len(given.payload or b"") + len(given.parameters)
        self.given = given
        self.answers = []

    def reply(self, payload, form):
        self.answers.append((payload, form))

    def reply_error(self, sentence):
        self.answers.append((sentence, None))

    def reply_part(self, payload, encoding):
        self.answers.append((payload, "cdr" if "cdr" in str(encoding) else "json"))

    def end(self):
        pass
