"""`mjplug teleop`: drives a robot with the keys of a terminal."""

import signal
import sys
import time
from typing import TYPE_CHECKING, Annotated, Any

import typer

from mjplug.cli.connected import connected
from mjplug.cli.names import complete_topic
from mjplug.cli.output import say

if TYPE_CHECKING:
    from mjplug.cli.teleop_keys import Drive
    from mjplug.client import Client, Publisher, Subscription

_TWIST, _STAMPED = "geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped"
_INTERRUPTED, _TERMINATED = 128 + signal.SIGINT, 128 + signal.SIGTERM
"""Exit codes after Ctrl-C or the end of the terminal, and after SIGTERM."""

_MATCHING_TIMEOUT = 5.0
"""How long to wait for a subscriber at the start [s]."""


@connected
def teleop(
    client: "Client",
    topic: Annotated[
        str | None,
        typer.Argument(
            metavar="TOPIC",
            help="Topic of the velocity. Default: the only one that a server subscribes to.",
            autocompletion=complete_topic,
        ),
    ] = None,
    speed: Annotated[float, typer.Option("--speed", min=0.0, metavar="M/S", help="Linear speed [m/s].")] = 0.5,
    turn: Annotated[float, typer.Option("--turn", min=0.0, metavar="RAD/S", help="Yaw rate [rad/s].")] = 1.0,
    repeat_rate: Annotated[
        float,
        typer.Option(
            "--repeat-rate",
            min=0.0,
            max=1000.0,
            metavar="HZ",
            help="Messages per second of wall time while a key is in effect; 0: only at a key [Hz].",
        ),
    ] = 10.0,
    key_timeout: Annotated[
        float,
        typer.Option(
            "--key-timeout",
            min=0.0,
            metavar="SECONDS",
            help="Time without a key after which the robot is stopped; 0: never.",
        ),
    ] = 0.7,
    stamped: Annotated[
        bool | None,
        typer.Option("--stamped/--no-stamped", help="Publish TwistStamped, or Twist. Default: as the topic."),
    ] = None,
    frame_id: Annotated[str, typer.Option("--frame-id", metavar="NAME", help="Frame of TwistStamped.")] = "",
) -> None:
    """Drives a robot with the keys of teleop_twist_keyboard.

    Ctrl-C stops the robot and exits.
    """
    from mjplug.cli.teleop_keys import HELP, Drive
    from mjplug.client import ClientError, TimedOutError

    if not sys.stdin.isatty():
        raise ClientError(
            "teleop reads keys from a terminal, but standard input is none; "
            "to publish from a script, use `mjplug topic pub`"
        )
    name, type = _topic(client, topic, stamped)
    publisher = client.publisher(name, type)
    if not publisher.wait_for_subscriber(_MATCHING_TIMEOUT):
        raise TimedOutError(f"no subscriber for {publisher.name} within {_MATCHING_TIMEOUT:g} s")
    clock = client.subscribe("/clock", "rosgraph_msgs/msg/Clock", depth=1) if type == _STAMPED else None
    say(f"Publishing {type} on {publisher.name}.\n\n{HELP}")
    _drive(_Commands(publisher, clock, frame_id), Drive(speed, turn), repeat_rate, key_timeout)


class _Commands:
    """Publishes velocities as Twist, or as TwistStamped with the simulated time.

    Args:
        publisher: The publisher.
        clock: The subscription of the simulated time for stamps; None publishes Twist.
        frame_id: Frame in the header.
    """

    def __init__(self, publisher: "Publisher[Any]", clock: "Subscription[Any] | None", frame_id: str) -> None:
        self._publisher = publisher
        self._clock = clock
        self._frame = frame_id

    def publish(self, velocity: tuple[float, float, float, float]) -> None:
        """Publishes a velocity along x, y and z [m/s] and a yaw rate [rad/s]."""
        x, y, z, yaw = velocity
        twist = {"linear": {"x": x, "y": y, "z": z}, "angular": {"x": 0.0, "y": 0.0, "z": yaw}}
        if self._clock is None:
            self._publisher.publish(twist)
            return
        time = self._clock.latest()
        stamp = {"sec": 0, "nanosec": 0} if time is None else time.clock.model_dump()
        self._publisher.publish({"header": {"stamp": stamp, "frame_id": self._frame}, "twist": twist})


def _topic(client: "Client", topic: str | None, stamped: bool | None) -> tuple[str, str]:
    """Returns the name and the type of the topic to publish on.

    Raises:
        ClientError: The topic is unknown, or several could be meant.
        WrongTypeError: It is not a velocity.
    """
    from mjplug.client import ClientError, UnknownNameError, WrongTypeError

    types = (_TWIST, _STAMPED) if stamped is None else (_STAMPED if stamped else _TWIST,)
    if topic is None:
        found = {name: info.type for name, info in client.topics().items() if info.type in types and info.subscribers}
        if len(found) == 1:
            return next(iter(found.items()))
        if found:
            raise ClientError(f"several servers or plugins follow a velocity; give one: {', '.join(sorted(found))}")
        raise ClientError(
            f"no server subscribes to a topic of {' or '.join(types)}; "
            "the plugin `base_velocity` does, or name the topic of another program, with --stamped or --no-stamped"
        )
    try:
        found_type = client.topic(topic).type
    except UnknownNameError as error:
        if stamped is None:
            raise ClientError(f"{error}; for a topic of another program, add --stamped or --no-stamped") from None
        return topic, types[0]
    if found_type not in types:
        raise WrongTypeError(f"topic {client.resolve(topic)} is {found_type}, not {' or '.join(types)}")
    return topic, found_type


def _drive(commands: _Commands, drive: "Drive", rate: float, key_timeout: float) -> None:
    """Publishes what the keys say until a signal ends it; then stops the robot and raises `typer.Exit`."""
    from mjplug.cli.key_terminal import KeyTerminal
    from mjplug.cli.teleop_keys import keys

    period = 1.0 / rate if rate > 0.0 else None
    pressed = time.monotonic()
    with KeyTerminal() as terminal:
        try:
            _show(drive)
            while True:
                now = time.monotonic()
                left = pressed + key_timeout - now if drive.moving and key_timeout > 0.0 else None
                waits = [wait for wait in (left, period if drive.moving else None) if wait is not None]
                text, signals = terminal.read(max(0.0, min(waits)) if waits else None)
                if text:
                    pressed = time.monotonic()
                    for key in keys(text):
                        drive.press(key)
                elif drive.moving and key_timeout > 0.0 and time.monotonic() - pressed >= key_timeout:
                    drive.stop()
                    _show(drive)
                if signal.SIGTSTP in signals:
                    drive.stop()
                    commands.publish(drive.velocity)
                    terminal.suspend()
                    _show(drive)
                elif signals:
                    raise typer.Exit(_TERMINATED if signal.SIGTERM in signals else _INTERRUPTED)
                commands.publish(drive.velocity)
                if text:
                    _show(drive)
        finally:
            drive.stop()
            commands.publish(drive.velocity)
            sys.stdout.write("\n")
            sys.stdout.flush()


def _show(drive: "Drive") -> None:
    """Shows the speeds on the last line of the terminal, over those before."""
    if sys.stdout.isatty():
        sys.stdout.write(f"\r\033[K{drive.text}")
        sys.stdout.flush()
