"""Hostile inputs made from a server's own listing of interfaces: each is one put, delete or query."""

import struct
from dataclasses import dataclass
from typing import Literal

import zenoh
from hostile.attack import random_of
from hostile.payloads import as_json, cdr, odd_json, spoilt
from hostile.values import Values

from mjplug_schemas import names
from mjplug_schemas.registry import find
from mjplug_schemas.rihs01 import type_hash
from mjplug_schemas.type_description_interfaces import GetTypeDescription

ENCODINGS = (
    "application/cdr",
    "application/json",
    "text/json",
    "zenoh/bytes",
    "zenoh/string",
    "text/plain",
    "image/png",
    "application/octet-stream",
    "application/cdr;std_msgs/msg/String",
    "application/json;x",
    "application/cdr;",
    "@/%;;",
    "APPLICATION/JSON",
    "application/json;charset=utf-8",
    "x" * 250,
)
"""Zenoh's Python library panics in the sender with encodings above 255 bytes, so none is longer."""

PARAMETERS = (
    "wait=false",
    "wait=true",
    "wait",
    "wait=%00",
    "=;;=;",
    "wait=%ff%zz",
    "a=b;" * 3000,
    "wait=true;wait=false",
    "_time=[now(-1s)..]",
    "_anyke",
    "schema=true",
    "schema=%C3%A9",
    "_max=0;_range=..;_sn=1..3",
    "\u540d=1",
    "owner=a",
    "owner=**",
    "owner=%00",
    "owner=" + "a" * 3000,
    "episode=7",
    "episode=-1",
    "episode=%C2%B2",
    "episode=" + "9" * 3000,
)

WILDCARDS = (
    "**",
    "**/@json",
    "*/*",
    "mjplug/*",
    "mjplug/**",
    "m$*",
    "*/@json",
    "0/**",
    "*/*/*/*",
    "$*/set_pause",
    "@mjplug/**",
    "@ros2_lv/**",
    "**/@adv/**",
    "mjplug/set_pause/**",
    "0/mjplug/set_pause/**",
    "@/**",
    "**/interfaces",
)


@dataclass(frozen=True)
class Interface:
    """A service, or a topic that the server reads or publishes.

    Attributes:
        kind: Which of the three.
        key: Its plain key.
        ros2_key: Its key for ROS 2 nodes.
        type_name: Its type.
        message: What goes in: the request, or the message.
    """

    kind: Literal["service", "subscribed", "published"]
    key: str
    ros2_key: str
    type_name: str
    message: type


@dataclass(frozen=True)
class Input:
    """One thing to send.

    Attributes:
        index: Its number in the run.
        verb: How it is sent.
        door: Which kind of key it goes to; `other` is anything but an interface's own keys.
        key: The key expression.
        interface: What it is aimed at.
        payload: The bytes.
        encoding: What they are said to be.
        attachment: What goes with them.
        parameters: The selector's parameters.
    """

    index: int
    verb: Literal["put", "delete", "get"]
    door: Literal["plain", "json", "ros2", "other"]
    key: str
    interface: Interface
    payload: bytes | None = None
    encoding: str | None = None
    attachment: bytes | None = None
    parameters: str = ""

    @property
    def selector(self):
        return f"{self.key}?{self.parameters}" if self.parameters else self.key

    @property
    def one_answer(self):
        """Whether exactly one service answers it."""
        return self.verb == "get" and self.door in ("plain", "ros2") and self.interface.kind == "service"


def interfaces_of(listing):
    """Returns the interfaces in a listing, with the service that only ROS 2 nodes have."""
    found = [
        Interface(topic["direction"], topic["key"], topic["ros2_key"], topic["type"], find(topic["type"]))
        for topic in listing["topics"]
    ]
    found += [
        Interface("service", service["key"], service["ros2_key"], service["type"], find(service["type"]).Request)
        for service in listing["services"]
    ]
    key, kind = f"{names.key(listing['name'])}/get_type_description", GetTypeDescription
    ros2_key = f"0/{key}/{names.dds_type(kind.TYPE)}/{type_hash(kind)}"
    found.append(Interface("service", key, ros2_key, kind.TYPE, kind.Request))
    return found


class Inputs:
    """Makes inputs; each depends on the seed and its index alone.

    Args:
        interfaces: What to aim at.
        seed: The seed.
        doors: Which kinds of keys to use.
    """

    def __init__(self, interfaces, seed, doors=("plain", "json", "ros2", "other")):
        self._services = [one for one in interfaces if one.kind == "service"]
        self._read = [one for one in interfaces if one.kind == "subscribed"]
        self._published = [one for one in interfaces if one.kind == "published"]
        self._seed = seed
        self._doors = doors

    def make(self, index):
        """Returns the input with a number."""
        random = random_of(self._seed, index)
        door = random.choices(
            self._doors, [{"plain": 50, "json": 12, "ros2": 25, "other": 13}[d] for d in self._doors]
        )[0]
        if door == "other":
            return self._elsewhere(index, random)
        if door == "json":
            interface, verb = random.choice(self._read), "put"
            payload, encoding = self._json(interface, random)
            return Input(index, verb, door, f"{interface.key}/@json", interface, payload, encoding)
        interface = random.choice(self._services if random.random() < 0.7 else self._read)
        if interface.key.endswith("/get_type_description"):
            door = "ros2"
        verb = "get" if interface.kind == "service" else "put" if random.random() < 0.98 else "delete"
        if door == "ros2":
            return self._from_node(index, random, interface, verb)
        payload, encoding = (self._json if random.random() < 0.5 else self._cdr)(interface, random)
        if verb == "get" and random.random() < 0.02:
            payload = None
        parameters = random.choice(PARAMETERS) if verb == "get" and random.random() < 0.15 else ""
        if verb == "get" and not parameters and "wrench" in interface.key and random.random() < 0.7:
            parameters = "wait=false"
        attachment = random.choice((b"", b"rqh" + bytes(17), random.randbytes(20))) if random.random() < 0.05 else None
        return Input(index, verb, door, interface.key, interface, payload, encoding, attachment, parameters)

    def _tree(self, interface, random):
        return Values(random, random.choice((0.0, 0.0, 0.1, 0.5))).message(interface.message)

    def _json(self, interface, random):
        tree = self._tree(interface, random)
        kind = random.random()
        if kind < 0.6:
            payload = as_json(tree, random.random() < 0.5)
        elif kind < 0.8:
            payload = odd_json(tree, random)
        else:
            payload = spoilt(as_json(tree), random)
        encoding = random.choice(ENCODINGS) if random.random() < 0.08 else random.choice(("application/json", None))
        return payload, encoding

    def _cdr(self, interface, random):
        payload = cdr(interface.message, self._tree(interface, random), random.choice("<<<>"))
        if random.random() < 0.45:
            payload = spoilt(payload, random)
        stated = random.choice(("application/cdr", f"application/cdr;{interface.type_name}", None))
        return payload, random.choice(ENCODINGS) if random.random() < 0.08 else stated

    def _from_node(self, index, random, interface, verb):
        """Returns a request of a ROS 2 node, with an attachment and a hash that may be invalid."""
        payload, _ = self._cdr(interface, random)
        attachment = struct.pack("<qqB", random.choice((1, 0, -1, 2**63 - 1)), random.randrange(2**62), 16)
        attachment += random.randbytes(16)
        if random.random() < 0.25:
            attachment = random.choice(
                (spoilt(attachment, random), None, b"", attachment[:32], attachment + b"\0", bytes(33), b"\xff" * 33)
            )
        key, kind = interface.ros2_key, random.random()
        if kind < 0.15:
            hashes = ("TypeHashNotSupported", "RIHS01_" + "0" * 64, "RIHS01_", "x", "RIHS02_é", "*")
            key = f"{key.rpartition('/')[0]}/{random.choice(hashes)}"
        return Input(index, verb, "ros2", key, interface, payload, None, attachment)

    def _elsewhere(self, index, random):
        """Returns what aims at the server's own outputs, at many keys at once, or beside them."""
        kind = random.randrange(6)
        interface = random.choice(self._published)
        payload, encoding = (self._json if random.random() < 0.5 else self._cdr)(interface, random)
        if kind == 0:
            key = random.choice((interface.key, f"{interface.key}/@json", interface.ros2_key))
            return Input(index, random.choice(("put", "put", "delete")), "other", key, interface, payload, encoding)
        if kind == 1:
            key = random.choice((interface.key, f"{interface.key}/@json", interface.ros2_key, "mjplug/interfaces"))
            parameters = random.choice(PARAMETERS)
            return Input(index, "get", "other", key, interface, payload, encoding, parameters=parameters)
        if kind == 2:
            key = random.choice(WILDCARDS)
            verb = random.choice(("get", "get", "put", "delete"))
            if verb != "get" and ("@/" in key or key.startswith("@")):
                verb = "get"
            return Input(index, verb, "other", key, interface, payload, encoding)
        if kind == 3:
            base = random.choice((interface.key, interface.ros2_key, random.choice(self._read).key, "mjplug"))
            key = f"{base}/@adv/{random.choice(('pub', 'sub', 'pub/a1/1/_/_', '**', 'x'))}"
            return Input(index, random.choice(("put", "get", "delete")), "other", key, interface, payload, encoding)
        if kind == 4:
            target = random.choice(self._services + self._read)
            key = f"{target.key}{random.choice(('/x', '/@json', '/@json/@json', '/é', '/@x/**'))}"
            return Input(index, random.choice(("put", "get", "delete")), "other", key, target, payload, encoding)
        # A request where a message is expected, and the other way round.
        target = random.choice(self._services + self._read)
        verb = "put" if target.kind == "service" else "get"
        payload, encoding = self._json(target, random)
        return Input(index, verb, "other", random.choice((target.key, target.ros2_key)), target, payload, encoding)


def encoding_of(given):
    """Returns Zenoh's encoding for a text."""
    return None if given is None else zenoh.Encoding(given)
