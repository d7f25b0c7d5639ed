"""A server's part of the wire, without physics: a test decides what it sends."""

import gzip
import hashlib
import json
import threading

import zenoh
from waits import TIMEOUT
from zenoh.handlers import Callback

from mjplug_schemas.rcl_interfaces import SetParameters
from mjplug_schemas.registry import find
from mjplug_schemas.rihs01 import type_hash

QOS = {"reliability": "reliable", "durability": "volatile", "depth": 10}


class FakeServer:
    """A server of some name.

    Attributes:
        hash: The hash of its drawing pack.
        queried: How often each part of the view was queried.
        permits: Whether clients may command it.
        received: Payloads that came in on its topics and on `@view/drag`, by key.
    """

    def __init__(
        self, endpoint, name="/mjplug", topics=(), subscribed=(), services=None, pack=b"pack", types=None, answers=True
    ):
        config = zenoh.Config()
        for key, value in (
            ("mode", "client"), ("connect/endpoints", [endpoint]), ("scouting/multicast/enabled", False),
        ):  # fmt: skip
            config.insert_json5(key, json.dumps(value))
        self.session = zenoh.open(config)
        self.name, self.key = name, name[1:]
        self.pack = gzip.compress(pack, mtime=0)
        self.hash = hashlib.sha256(self.pack).hexdigest()
        self.queried, self.received = {}, {}
        self._services = services or {}
        self._topics, self._subscribed = dict(topics), dict(subscribed)
        self._types = types or {}
        self._arrived = threading.Condition()
        self.info = {"name": name, "scene": self.hash, "epoch": 0, "paused": False, "speed": 1.0, "bodies": ["world"]}
        self._kept = [
            self._queryable(f"{self.key}/@view/scene", lambda query: self.pack),
            self._subscribe(f"{self.key}/@view/drag"),
            self._queryable(f"{self.key}/set_parameters", self._set_parameters),
            *(self._subscribe(topic[1:]) for topic in self._subscribed),
            *(self._queryable(service[1:], answer) for service, (_, answer) in self._services.items()),
        ]
        if answers:
            self.answer()
        self._publishers = {}
        self.permits = True
        self.token = self.session.liveliness().declare_token(f"@mjplug/{self.key}/{self.session.info.zid()}")

    def answer(self, info=None):
        """Declares what answers to queries for the interfaces and the description."""
        info = info or (lambda query: json.dumps(self.info).encode())
        self._kept += [
            self._queryable(f"{self.key}/interfaces", self._interfaces),
            self._queryable(f"{self.key}/@view/info", info),
        ]

    def publisher(self, key):
        if key not in self._publishers:
            # A busy machine must not drop any.
            block = zenoh.CongestionControl.BLOCK
            self._publishers[key] = self.session.declare_publisher(key, congestion_control=block)
        return self._publishers[key]

    def frame(self, payload):
        self.publisher(f"{self.key}/@view/frame").put(payload)

    def send(self, topic, message):
        self.publisher(topic[1:]).put(bytes(message.to_cdr()))

    def matched(self, key, within=TIMEOUT):
        """Waits until a key has a subscriber."""
        return self._matching(key, True, within)

    def unmatched(self, key, within=TIMEOUT):
        """Waits until a key has no subscriber."""
        return self._matching(key, False, within)

    def wait_for(self, key, count=1, within=TIMEOUT):
        """Returns the payloads that came in on a key, as soon as there are enough of them."""
        with self._arrived:
            there = self._arrived.wait_for(lambda: len(self.received.get(key, ())) >= count, within)
            assert there, f"{key} got {self.received.get(key)}"
            return list(self.received[key])

    def wait_for_queries(self, key, count, within=TIMEOUT):
        """Waits until a key has been queried often enough."""
        with self._arrived:
            assert self._arrived.wait_for(lambda: self.queried.get(key, 0) >= count, within), self.queried

    def left(self, keys):
        """Returns a queue-like list of the liveliness tokens on some keys that have appeared (True) or left (False)."""
        seen = []
        handler = Callback(lambda sample: seen.append(sample.kind == zenoh.SampleKind.PUT), indirect=False)
        self._kept.append(self.session.liveliness().declare_subscriber(keys, handler))
        return seen

    def stop(self):
        if not self.session.is_closed():
            self.session.close()

    def _matching(self, key, wanted, within):
        publisher, reached = self.publisher(key), threading.Event()

        def changed(status):
            if status.matching == wanted:
                reached.set()

        listener = publisher.declare_matching_listener(Callback(changed, indirect=False))
        if publisher.matching_status.matching == wanted:
            reached.set()
        found = reached.wait(within)
        listener.undeclare()
        assert found, f"{key} has {'no' if wanted else 'a'} subscriber"

    def _queryable(self, key, answer):
        def receive(query):
            with query:
                with self._arrived:
                    self.queried[key] = self.queried.get(key, 0) + 1
                    self._arrived.notify_all()
                try:
                    payload = answer(query)
                except ValueError as error:
                    query.reply_err(str(error).encode())
                else:
                    if payload is not None:
                        query.reply(key, payload)

        return self.session.declare_queryable(key, Callback(receive, indirect=False))

    def _subscribe(self, key):
        def receive(sample):
            with self._arrived:
                self.received.setdefault(key, []).append(bytes(sample.payload))
                self._arrived.notify_all()

        return self.session.declare_subscriber(key, Callback(receive, indirect=False))

    def _set_parameters(self, query):
        assert SetParameters.Request.from_cdr(bytes(query.payload)).parameters == ()
        return bytes(SetParameters.Response().to_cdr()) if self.permits else None

    def _interfaces(self, query):
        def topic(name, type, direction):
            type, qos = type if isinstance(type, tuple) else (type, QOS)
            return {
                "name": name, "direction": direction, "key": name[1:], "json_key": f"{name[1:]}/@json", "type": type,
                "hash": "", "qos": qos,
            }  # fmt: skip

        content = {
            "name": self.name, "version": "0", "endpoint": "",
            "topics": [
                *(topic(name, type, "published") for name, type in self._topics.items()),
                *(topic(name, type, "subscribed") for name, type in self._subscribed.items()),
            ],
            "services": [
                {"name": name, "key": name[1:], "type": type, "hash": ""}
                for name, (type, _) in self._services.items()
            ],
        }  # fmt: skip
        if "schema" in str(query.parameters):
            content["types"] = {name: {"definition": text} for name, text in self._types.items()}
        return json.dumps(content).encode()


def hash_of(type):
    return type_hash(find(type))
