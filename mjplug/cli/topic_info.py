"""The texts of `mjplug topic list --verbose` and `topic info`, in the format of ros2."""

from collections.abc import Iterator, Mapping

from mjplug.client import ServerInfo, TopicInfo


def overview(topics: Mapping[str, TopicInfo]) -> Iterator[str]:
    """Yields a list of the topics with publishers, and a list of those with subscribers."""
    yield "Published topics:"
    yield from (_counted(topic, len(topic.publishers), "publisher") for topic in topics.values() if topic.publishers)
    yield ""
    yield "Subscribed topics:"
    yield from (_counted(topic, len(topic.subscribers), "subscriber") for topic in topics.values() if topic.subscribers)
    yield ""


def _counted(topic: TopicInfo, count: int, what: str) -> str:
    return f" * {topic.name} [{topic.type}] {count} {what}{'' if count == 1 else 's'}"


def summary(topic: TopicInfo) -> Iterator[str]:
    """Yields the lines about a topic: its type and the numbers of its publishers and subscribers."""
    yield f"Type: {topic.type}"
    yield f"Publisher count: {len(topic.publishers)}"
    yield f"Subscription count: {len(topic.subscribers)}"


def details(topic: TopicInfo, servers: Mapping[str, ServerInfo]) -> Iterator[str]:
    """Yields the lines about a topic, its publishers and its subscribers.

    Args:
        topic: The topic.
        servers: The servers by name.
    """
    for heading, ends, kind in (
        ("Publisher count", topic.publishers, "PUBLISHER"),
        ("Subscription count", topic.subscribers, "SUBSCRIPTION"),
    ):
        if kind == "PUBLISHER":
            yield f"Type: {topic.type}"
            yield ""
        yield f"{heading}: {len(ends)}"
        yield ""
        for name in ends:
            yield from _end(name, servers[name].topics[topic.name] if name in servers else topic, kind)
            yield ""


def _end(server: str, topic: TopicInfo, kind: str) -> Iterator[str]:
    namespace, _, node = server.rpartition("/")
    yield f"Node name: {node}"
    yield f"Node namespace: {namespace or '/'}"
    yield f"Topic type: {topic.type}"
    yield f"Topic type hash: {topic.hash}"
    yield f"Endpoint type: {kind}"
    yield f"Key: {topic.key} (JSON: {topic.json_key})"
    yield "QoS profile:"
    yield f"  Reliability: {topic.reliability.upper()}"
    yield f"  History (Depth): KEEP_LAST ({topic.depth})"
    yield f"  Durability: {topic.durability.upper()}"
    yield "  Lifespan: Infinite"
    yield "  Deadline: Infinite"
    yield "  Liveliness: AUTOMATIC"
    yield "  Liveliness lease duration: Infinite"
