"""Waits for a model on a topic, before the server itself is on the network."""

import logging
import os
from collections.abc import Mapping
from contextlib import closing
from dataclasses import dataclass

from mjplug.config.draft import Loaded
from mjplug.config.load import TOPIC
from mjplug.config.problem import ConfigError
from mjplug.contracts.transport import QoS, Topic
from mjplug.convert.cache import cache_folder
from mjplug.convert.received import ReceivedModel, check_text, store
from mjplug.errors import ModelError
from mjplug.wire.access import Interfaces
from mjplug.wire.latched_text import NoTextError, TextTopic, receive_text
from mjplug.wire.rmw_zenoh.keys import RosSettings
from mjplug.wire.secured import secured
from mjplug.wire.session import SessionSettings, open_session
from mjplug_schemas import names
from mjplug_schemas.errors import NameRuleError
from mjplug_schemas.std_msgs import String

_LATCHED = QoS(1, durability="transient_local")

_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Wait:
    """How to wait for a model.

    Attributes:
        topic: The topic.
        session: Settings of the Zenoh session.
        name: Full name of the server.
        timeout: How long to wait [s].
    """

    topic: TextTopic
    session: SessionSettings
    name: str
    timeout: float

    def receive(self, environ: Mapping[str, str] = os.environ) -> ReceivedModel:
        """Returns the first usable model on the topic.

        Raises:
            ModelError: None arrived in time, or the cache cannot be written.
            WireError: The Zenoh session cannot be opened.
        """
        settings = secured(self.session, self._interfaces)
        with closing(open_session(settings, self.name, self.timeout)) as session:
            listening = f"listening on {', '.join(session.listening)}" if session.listening else ""
            joined = f"connecting to {', '.join(session.joined)}" if session.joined else ""
            _log.info(
                "the model comes from %s (model_timeout: %g s); this is a Zenoh %s, %s",
                self.topic.name,
                self.timeout,
                session.role,
                ", ".join(filter(None, (listening, joined))),
            )
            try:
                text = receive_text(session.zenoh, self.topic, self.timeout, _tell, check_text)
            except NoTextError as error:
                raise ModelError(f"{error} (model_timeout sets the time limit)") from error
        _log.info("received the model on %s (%d characters)", self.topic.name, len(text))
        return store(self.topic.name, text, cache_folder(environ))

    def _interfaces(self) -> Interfaces:
        """Returns what clients with roles may use while the server waits."""
        return Interfaces(self.name, [], [Topic(self.topic.name, String, _LATCHED)], [], self.topic.ros2)


def is_topic(model: str) -> bool:
    """Returns whether a model comes from a topic."""
    return model.startswith(TOPIC)


def wait_for(loaded: Loaded) -> Wait:
    """Returns how a server waits for the model in its configuration.

    Raises:
        ConfigError: The name of the topic is invalid.
    """
    settings = loaded.settings
    node = f"{settings.namespace}/{settings.node_name}"
    try:
        topic = names.resolve(
            settings.model.removeprefix(TOPIC),
            namespace=settings.namespace,
            node=settings.node_name,
            remap=settings.remap,
        )
    except NameRuleError as error:
        raise ConfigError([loaded.problem(("model",), str(error))]) from error
    ros2 = RosSettings(settings.ros2.domain_id, settings.ros2.distro) if settings.ros2.enabled else None
    zenoh = settings.zenoh
    session = SessionSettings(zenoh.mode, zenoh.listen, zenoh.connect, loaded.path(("zenoh", "config")))
    return Wait(TextTopic(topic, ros2, zenoh.max_payload_bytes), session, node, settings.model_timeout)


def _tell(line: str) -> None:
    _log.info("%s", line)
