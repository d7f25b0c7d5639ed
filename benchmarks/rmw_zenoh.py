"""Cost of the rmw_zenoh interfaces for ROS 2 nodes, and delay of a latched message for a late subscriber."""

import queue
import statistics
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from time import perf_counter, sleep
from typing import Any

import numpy as np
from zenoh.ext import HistoryConfig, RecoveryConfig, declare_advanced_subscriber

from benchmarks.measure import Result, figure
from benchmarks.publication import JOINTS, PAUSE
from benchmarks.world import client, network
from mjplug.contracts.cdr_frame import CdrFrame
from mjplug.contracts.transport import LATCHED, Publisher, QoS, Topic
from mjplug.wire.dialect import KeyWriter
from mjplug.wire.network import Network
from mjplug.wire.publisher import WirePublisher
from mjplug.wire.rmw_zenoh.key_writers import LiveRmwWriter
from mjplug.wire.rmw_zenoh.keys import RosSettings
from mjplug_schemas.sensor_msgs import JointState
from mjplug_schemas.std_msgs import String

ROS = RosSettings()

MESSAGES, BURST, TURNS = 4000, 25, 7
"""Messages of each kind in one repetition, messages between two pauses, and number of repetitions."""

_SUBSCRIBERS = """
import json, sys, zenoh
config = zenoh.Config()
config.insert_json5("mode", '"client"')
config.insert_json5("connect/endpoints", json.dumps([sys.argv[1]]))
sessions = [zenoh.open(config) for _ in sys.argv[2:]]
kept = [session.declare_subscriber(key, lambda sample: None) for session, key in zip(sessions, sys.argv[2:])]
sys.stdin.read()
for session in sessions:
    session.close()
"""

Send = Callable[[], None]


@dataclass(frozen=True)
class _Size:
    """A kind of message: its name, its type, and a factory of the function that builds and publishes it."""

    what: str
    type: Any
    sender: Callable[[Publisher[Any]], Send]


def _heartbeat(publisher: Publisher[String]) -> Send:
    def send() -> None:
        publisher.publish(String(data=f"MuJoCo ROS2 Control Heartbeat #{1234} | Simulation time: {617.5:.3f}s"))

    return send


def _joint_state(publisher: Publisher[JointState]) -> Send:
    zeros = [0.0] * JOINTS
    frame = CdrFrame(
        JointState(name=[f"joint_{i}" for i in range(JOINTS)], position=zeros, velocity=zeros, effort=zeros)
    )
    views = [frame.view(part) for part in ("position", "velocity", "effort")]
    values = np.random.default_rng(0).normal(size=JOINTS)

    def send() -> None:
        for view in views:
            view[:] = values
        frame.set_stamp("header.stamp", 2_000_000)
        publisher.publish_frame(frame)

    return send


SIZES = (_Size("a heartbeat", String, _heartbeat), _Size("a 30-joint JointState", JointState, _joint_state))


def results() -> list[Result]:
    """Measures messages of each kind alternately; each subscriber uses a separate session."""
    return [_without_subscribers(), *(row for size in SIZES for row in _with_subscribers(size)), _late_joiner()]


def _without_subscribers() -> Result:
    topic = Topic("/mujoco_heartbeat", String, QoS())
    message = String(data="for nobody")
    with network() as plain, network(ROS) as both:
        sends = [partial(opened.open_publisher(topic).publish, message) for opened in (plain, both)]

        def extra() -> float:
            without, with_ros = _alternate(sends)
            return statistics.median(with_ros) - statistics.median(without)

        what = "extra for a message without a subscriber, with ROS 2 on against off"
        return figure(what, extra, "<= 0.3", "{:.3f} µs", TURNS)


def _with_subscribers(size: _Size) -> Iterator[Result]:
    with network(ROS) as opened, ExitStack() as stack:
        off, one, two = (Topic(name, size.type, QoS()) for name in ("/off", "/one", "/two"))
        publishers = [
            _open_subscribed(stack, opened, topic, ros) for topic, ros in ((off, False), (one, False), (two, True))
        ]
        # The same session, because two sessions differ by more than the measured difference.
        publishers[0] = WirePublisher(off, [writer for writer in publishers[0].writers if not _is_ros(writer)])
        sends = [size.sender(publisher) for publisher in publishers]
        _alternate(sends)
        costs = [[statistics.median(each) for each in _alternate(sends)] for _ in range(TURNS)]
    extras = [plain - without for without, plain, _ in costs]
    ratios = [both / plain for _, plain, both in costs]
    extra, ratio = statistics.median(extras), statistics.median(ratios)
    yield Result(
        f"extra for {size.what} with one plain subscriber, with ROS 2 on against off",
        f"{extra:.2f} µs",
        "",
        extra,
        min(extras),
        max(extras),
        "<= 0.3",
    )
    _, other, ours = (f"{statistics.median(column):.2f} µs" for column in zip(*costs, strict=True))
    yield Result(
        f"build and publish {size.what} to a plain and a ROS 2 subscriber, against the plain one alone",
        ours,
        other,
        ratio,
        min(ratios),
        max(ratios),
        "<= 1.6",
    )


def _late_joiner() -> Result:
    topic = Topic("/robot_description", String, LATCHED)
    with network(ROS) as opened:
        opened.open_publisher(topic).publish(String(data="<robot/>" * 1000))

        def wait() -> float:
            samples: queue.SimpleQueue[object] = queue.SimpleQueue()
            with client(opened.session.endpoint) as session:
                # A first query, so that the connection is not measured.
                list(session.get("mjplug/interfaces"))
                began = perf_counter()
                kept = declare_advanced_subscriber(
                    session,
                    ROS.data_key(topic.name, topic.type),
                    samples.put,
                    history=HistoryConfig(detect_late_publishers=True, max_samples=1),
                    recovery=RecoveryConfig(periodic_queries=None, heartbeat=True),
                    subscriber_detection=True,
                )
                samples.get(timeout=10)
                elapsed = perf_counter() - began
                kept.undeclare()
            return elapsed * 1e3

        what = "time until a late ROS 2 subscriber gets the last message of a latched topic"
        return figure(what, wait, "<= 50", "{:.1f} ms", 31)


def _is_ros(writer: KeyWriter) -> bool:
    return isinstance(writer, LiveRmwWriter)


def _open_subscribed(stack: ExitStack, opened: Network, topic: Topic[Any], ros: bool) -> WirePublisher[Any]:
    """Opens a publisher with subscribers in another process."""
    keys = [topic.name[1:], *([ROS.data_key(topic.name, topic.type)] if ros else [])]
    matched = threading.Semaphore(0)
    publisher = opened.open_publisher(topic, matched.release)
    command = [sys.executable, "-c", _SUBSCRIBERS, opened.session.endpoint, *keys]
    process = subprocess.Popen(command, stdin=subprocess.PIPE)
    stack.callback(process.wait, 10)
    stack.callback(process.terminate)
    for _ in keys:
        assert matched.acquire(timeout=10)
    return publisher


def _alternate(sends: Sequence[Send]) -> list[list[float]]:
    """Returns the duration of each message, for each kind [µs]; the order is reversed each time."""
    measured: list[list[float]] = [[] for _ in sends]
    for message in range(MESSAGES):
        order = range(len(sends)) if message % 2 else reversed(range(len(sends)))
        for at in order:
            began = perf_counter()
            sends[at]()
            measured[at].append((perf_counter() - began) * 1e6)
        if message % BURST == 0:
            sleep(PAUSE)
    return measured
