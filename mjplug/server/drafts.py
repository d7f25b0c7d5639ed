"""Reads a configuration; a robot description alone gets the plugins that fit the robot."""

import logging
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from time import monotonic

from mjplug.config.load import Draft, Option, Setting, read
from mjplug.convert.load import ConvertedRobot, Progress, converted_received, converted_robot, is_description
from mjplug.convert.report import RECORD
from mjplug.server.topic_model import is_topic, wait_for

_FIRST_LINE, _PERIOD = 2.0, 5.0
"""Times after which the log contains the first line about a conversion, and each further one [s]."""

_MEANINGFUL = 0.1
"""Finished part of a conversion from which its duration can be estimated."""

_log = logging.getLogger(__name__)


def read_draft(
    path: str | Path | Mapping[str, object],
    *,
    model: str | None = None,
    sets: Sequence[str | Option | Setting] = (),
    environ: Mapping[str, str] = os.environ,
) -> Draft:
    """Reads a configuration as `mjplug.config.load.read` does.

    If it is a URDF or xacro file instead of a configuration, the robot is converted, and the plugins for its joints,
    frames and sensors are added. Arguments and `--set` can change their parameters. The same applies to the URDF on a
    topic, `topic:/robot_description`, for which this function waits.

    Raises:
        ConfigError: The configuration cannot be read.
        ModelError: The robot cannot be converted, or did not arrive in time.
        WireError: The Zenoh session for a topic cannot be opened.
    """
    draft = read(path, model=model, sets=sets, environ=environ)
    if isinstance(path, str) and is_topic(path):
        return _read_topic(path, draft, sets, environ)
    if isinstance(path, Mapping) or not is_description(path):
        return draft
    robot = converted(draft, str(path), environ)
    if robot is None:
        return draft
    return read(path, sets=sets, environ=environ, defaults={"plugins": robot.plugins()})


def _read_topic(uri: str, draft: Draft, sets: Sequence[str | Option | Setting], environ: Mapping[str, str]) -> Draft:
    wait = wait_for(draft.finish())
    received = wait.receive(environ)
    if received.is_description:
        progress = log_conversion(received.topic)
        robot = converted_received(received, draft.model_options, environ, progress)
        plugins = robot.plugins()
        namespace = draft.finish().settings.namespace
        if f"{namespace}/robot_description" == received.topic:
            # Otherwise two latched publishers would offer two descriptions to late subscribers.
            _log.info("this server does not publish %s, because its model comes from there", received.topic)
            del plugins["robot_description"]
        draft = read(uri, sets=sets, environ=environ, defaults={"plugins": plugins})
    draft.received = received
    return draft


def converted(draft: Draft, uri: str, environ: Mapping[str, str] = os.environ) -> ConvertedRobot | None:
    """Returns the converted robot of a configuration; None if its model is not a robot description."""
    return converted_robot(
        uri,
        *draft.folders(("model",)),
        options=draft.model_options,
        environ=environ,
        progress=log_conversion(uri),
    )


def log_conversion(name: str) -> Progress:
    """Returns a function that logs the stages of a conversion of the file `name`, if it takes long."""
    return _LoggedProgress(name)


def log_report(robot: ConvertedRobot) -> None:
    """Logs what the conversion of a robot has lost and repaired."""
    report = robot.report()
    for line in report.summary("error", "warning", "loss"):
        _log.warning("%s", line)
    for line in report.summary("repair"):
        _log.info("repaired: %s", line)
    guesses = len(report.of("guess"))
    if guesses:
        _log.info("%d values were guessed; %s lists them", guesses, robot.folder / RECORD)


class _LoggedProgress:
    """Logs the stages of a conversion that takes long, with the time that is left.

    Args:
        name: The file.
    """

    def __init__(self, name: str) -> None:
        self._name, self._start, self._next = name, monotonic(), _FIRST_LINE

    def __call__(self, stage: str, part: float) -> None:
        elapsed = monotonic() - self._start
        if elapsed >= self._next and part < 1.0:
            remaining = elapsed / part - elapsed if part > _MEANINGFUL else 0.0
            left = f", about {remaining:.0f} s left" if remaining >= 1.0 else ""
            _log.info("converting %s: %s%s", self._name, stage, left)
            self._next = elapsed + _PERIOD
