"""Topics and frames that a `<gazebo>` element gives to a sensor."""

from collections.abc import Collection
from xml.etree.ElementTree import Element

_FRAMES = ("gz_frame_id", "ignition_frame_id", "frame_id")
_CLASSIC_FRAMES = ("plugin/frame_name", "plugin/frameName")
_CLASSIC_TOPICS = ("plugin/topicName", "plugin/topic_name")


def topic_of(element: Element) -> str:
    """Returns the topic of a sensor; empty if the element contains none.

    It is `<topic>` of Gazebo Sim, or a remapping `~/out:=NAME` or `<topicName>` of the plugins of Gazebo Classic. A
    relative topic is in the namespace of the server.
    """
    name = _text(element, ("topic",))
    if not name:
        for remapping in element.iterfind("plugin/ros/remapping"):
            before, _, after = (remapping.text or "").strip().partition(":=")
            name = after if before in ("~/out", "out") else name
    return absolute(name or _text(element, _CLASSIC_TOPICS))


def frame_of(element: Element, links: Collection[str]) -> tuple[str, str]:
    """Returns the frame of a sensor's messages if it is a link, and otherwise its name as the second value."""
    name = _text(element, (*_FRAMES, *_CLASSIC_FRAMES)).lstrip("/")
    return (name, "") if name in links else ("", name)


def camera_topics(element: Element, kind: str) -> dict[str, str]:
    """Returns the parameters of the plugin `camera` for the topics of a camera."""
    topic = topic_of(element)
    info = absolute(_text(element, ("camera/camera_info_topic",)))
    if not topic:
        return {"info_topic": info} if info else {}
    if kind.startswith("rgbd"):
        names = {"image_topic": f"{topic}/image", "depth_topic": f"{topic}/depth_image"}
        return names | {"info_topic": info or f"{topic}/camera_info"}
    above = topic.rpartition("/")[0]
    return {
        "depth_topic" if kind.startswith("depth") else "image_topic": topic,
        "info_topic": info or f"{above}/camera_info",
    }


def absolute(name: str) -> str:
    """Returns a topic as a configuration names it: relative to the namespace of the server, or absolute."""
    return name if not name or name.startswith("/") else f"{{ns}}/{name}"


def _text(element: Element, paths: Collection[str]) -> str:
    found = ((element.findtext(path) or "").strip() for path in paths)
    return next((text for text in found if text), "")
