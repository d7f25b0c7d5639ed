"""Gets the robot for `mjplug convert topic:/robot_description`."""

import os
from typing import TYPE_CHECKING

import typer

from mjplug.errors import ModelError

if TYPE_CHECKING:
    from mjplug.convert.received import ReceivedModel

_DEFAULT = "tcp/127.0.0.1:7447"


def is_topic(file: str) -> bool:
    """Returns whether an argument names a topic instead of a file."""
    from mjplug.config.load import TOPIC

    return file.startswith(TOPIC)


def receive_description(uri: str, endpoint: str | None, timeout: float) -> "ReceivedModel":
    """Waits for the URDF on a topic.

    Args:
        uri: `topic:` and the name of the topic.
        endpoint: Zenoh endpoint to connect to; None for the default.
        timeout: How long to wait [s].

    Raises:
        ModelError: It does not arrive in time, or is MJCF.
        WireError: The endpoint does not answer.
    """
    from mjplug.config.load import TOPIC
    from mjplug.log import logging_to_stderr
    from mjplug.server.topic_model import Wait
    from mjplug.wire.encoding import MAX_PAYLOAD
    from mjplug.wire.latched_text import TextTopic
    from mjplug.wire.rmw_zenoh.keys import RosSettings
    from mjplug.wire.session import SessionSettings
    from mjplug_schemas import names
    from mjplug_schemas.errors import NameRuleError

    name = uri.removeprefix(TOPIC)
    try:
        names.validate_name(name)
        domain = int(os.environ.get("ROS_DOMAIN_ID") or 0)
    except NameRuleError as error:
        raise typer.BadParameter(str(error), param_hint="FILE") from None
    except ValueError:
        raise ModelError(f"ROS_DOMAIN_ID is {os.environ['ROS_DOMAIN_ID']!r}; it must be a number") from None
    topic = TextTopic(name, RosSettings(domain), MAX_PAYLOAD)
    session = SessionSettings("client", None, (endpoint or _DEFAULT,))
    with logging_to_stderr(0):
        received = Wait(topic, session, "", timeout).receive()
    if not received.is_description:
        raise ModelError(f"the text on {name} is MJCF, which needs no conversion; run it: mjplug serve {uri}")
    return received
