"""The publishers of a playback: the topics of a bag on the network, as a server publishes them."""

from collections.abc import Callable, Iterable, Mapping
from typing import Any

import zenoh

from mjplug.bag.definitions import class_of
from mjplug.bag.errors import BagError
from mjplug.bag.reader import Bag
from mjplug.bag.topics import BagTopic
from mjplug.contracts.transport import CLOCK, LATCHED, Topic
from mjplug.errors import MjplugError
from mjplug.wire.discovery import questions
from mjplug.wire.discovery.announced import NoAnswerError
from mjplug.wire.network import Network
from mjplug.wire.publisher import WirePublisher
from mjplug.wire.rmw_zenoh.tokens import ROOT
from mjplug.wire.shared_names import BY_CONVENTION
from mjplug_schemas.errors import CodecError, DefinitionError, NameRuleError
from mjplug_schemas.names import validate_name
from mjplug_schemas.rosgraph_msgs import Clock
from mjplug_schemas.std_msgs import UInt64

NAME = "/mjplug_play"
"""Full name of the node."""

EPOCH = f"{NAME}/epoch"
CLOCK_TOPIC = "/clock"

_TIMEOUT = 2.0


class LivePublisherError(MjplugError):
    """Other programs publish topics that would be played."""


def chosen_topics(bag: Bag, chosen: Callable[[str], bool]) -> dict[str, BagTopic]:
    """Returns the topics of a bag that are played, by name.

    Raises:
        BagError: A topic has several types, or a file is damaged.
    """
    found: dict[str, BagTopic] = {}
    for file in bag.summaries():
        if file.damage:
            raise BagError(f"{file.path} is damaged ({file.damage}); mjplug bag recover makes a bag of the rest")
        for topic in file.topics.values():
            if not chosen(topic.name):
                continue
            if found.setdefault(topic.name, topic).type != topic.type:
                raise BagError(f"topic {topic.name} has two types in {bag.path}; leave it out with --exclude")
    return found


class Outputs:
    """The publishers of a playback.

    Attributes:
        skipped: Why topics are not played, by name.
        unreadable: Number of messages that were not converted to JSON because they are not of the type of their topic.

    Args:
        network: The network.
        topics: The topics.
        remap: New names by names.
        clock: Whether the playback publishes `/clock` itself, in place of a recorded one.
    """

    def __init__(self, network: Network, topics: Mapping[str, BagTopic], remap: Mapping[str, str], clock: bool) -> None:
        self.skipped: dict[str, str] = {}
        self.unreadable = 0
        self._publishers: dict[str, WirePublisher[Any]] = {}
        for name, topic in topics.items():
            played = remap.get(name, name)
            if clock and played == CLOCK_TOPIC:
                self.skipped[name] = "the playback publishes it itself, as --clock says"
                continue
            try:
                validate_name(played)
                type = class_of(topic.type, topic.definition)
                self._publishers[name] = network.open_publisher(Topic(played, type, topic.qos))
            except (BagError, NameRuleError, DefinitionError) as error:
                self.skipped[name] = str(error)
        self._clock = network.open_publisher(Topic(CLOCK_TOPIC, Clock, CLOCK)) if clock else None
        self._epoch = network.open_publisher(Topic(EPOCH, UInt64, LATCHED))

    def publish(self, topic: str, data: bytes) -> bool:
        """Publishes a message; returns whether its topic is played."""
        publisher = self._publishers.get(topic)
        if publisher is None:
            return False
        try:
            publisher.publish_cdr(data)
        except CodecError:
            # Subscribers of CDR have got it; it cannot be converted for those of JSON.
            self.unreadable += 1
        return True

    def publish_clock(self, time_ns: int) -> None:
        """Publishes a time on `/clock`, if the playback does so."""
        if self._clock is not None and self._clock.matched:
            self._clock.publish(Clock(clock=_time(time_ns)))

    def publish_epoch(self, epoch: int) -> None:
        """Publishes the number of jumps of the time."""
        self._epoch.publish(UInt64(data=epoch))


def _time(time_ns: int) -> Any:
    from mjplug_schemas.builtin_interfaces import Time  # noqa: PLC0415

    return Time.from_ns(time_ns)


def refuse_live_publishers(session: zenoh.Session, domain_id: int, played: Mapping[str, str]) -> None:
    """Checks that no other program publishes what will be played.

    Args:
        session: The session of the playback.
        domain_id: The ROS domain.
        played: Types of the topics by the name under which they will be played.

    Raises:
        LivePublisherError: A server or a ROS 2 node publishes one of the topics.
    """
    names = {name for name, type in played.items() if type not in BY_CONVENTION}
    rivals: dict[str, set[str]] = {}
    try:
        servers, _ = questions.ask_all(session, _TIMEOUT)
    except NoAnswerError:
        servers = {}
    for server in servers.values():
        for topic in server.topics.values():
            if topic.publishers and topic.name in names and server.name != NAME:
                rivals.setdefault(server.name, set()).add(topic.name)
    own = str(session.zid())
    for token in _publishers_of_ros(session, domain_id):
        # @ros2_lv/<domain>/<zid>/<nid>/<eid>/MP/<enclave>/<namespace>/<node>/<name>/<type>/<hash>/<qos>
        chunks = token.split("/")
        if len(chunks) >= 13 and chunks[2] != own:
            name, node = chunks[9].replace("%", "/"), f"{chunks[7].replace('%', '/').rstrip('/')}/{chunks[8]}"
            if name in names:
                rivals.setdefault(node, set()).add(name)
    if rivals:
        who = "; ".join(f"{node} publishes {', '.join(sorted(topics))}" for node, topics in sorted(rivals.items()))
        raise LivePublisherError(
            f"{who}: subscribers could not tell the bag from it; stop it, play other topics with --topics or "
            "--exclude, rename them with --remap /a:=/b, or play anyway with --force"
        )


def _publishers_of_ros(session: zenoh.Session, domain_id: int) -> Iterable[str]:
    for reply in session.liveliness().get(f"{ROOT}/{domain_id}/*/*/*/MP/**", timeout=_TIMEOUT):
        if reply.ok is not None:
            yield str(reply.ok.key_expr)
