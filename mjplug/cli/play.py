"""`mjplug play`: plays a bag."""

import contextlib
import os
import re
import signal
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mjplug.cli.connected import Endpoint, ZenohConfig
from mjplug.cli.ending import EndingSignals
from mjplug.cli.output import complain, say

if TYPE_CHECKING:
    from mjplug.player.player import Key, Player

_KEYS: "dict[str, Key]" = {
    " ": "pause",
    "\x1b[C": "next",
    "\x1bOC": "next",
    "\x1b[A": "faster",
    "\x1bOA": "faster",
    "\x1b[B": "slower",
    "\x1bOB": "slower",
}
_KEY = re.compile(r"\x1b[\[O][A-D]| ")
_INTERRUPTED, _TERMINATED = 130, 143


def play(
    bag: Annotated[Path, typer.Argument(metavar="BAG", help="Folder of a bag, or an MCAP file.")],
    rate: Annotated[
        float, typer.Option("--rate", "-r", min=0.01, max=100.0, metavar="FACTOR", help="Speed of the playback.")
    ] = 1.0,
    loop: Annotated[bool, typer.Option("--loop", "-l", help="Begin again at the end.")] = False,
    start_paused: Annotated[bool, typer.Option("--start-paused", "-p", help="Wait for the space key.")] = False,
    start_offset: Annotated[
        float, typer.Option("--start-offset", min=0.0, metavar="SECONDS", help="Leave out this time at the beginning.")
    ] = 0.0,
    delay: Annotated[
        float, typer.Option("--delay", "-d", min=0.0, metavar="SECONDS", help="Wait before the first message.")
    ] = 0.0,
    topics: Annotated[
        list[str] | None, typer.Option("--topics", metavar="TOPIC", help="Play only this topic. Repeatable.")
    ] = None,
    exclude: Annotated[
        str | None, typer.Option("--exclude", "-x", metavar="REGEX", help="Leave out topics whose names match.")
    ] = None,
    remap: Annotated[
        list[str] | None, typer.Option("--remap", "-m", metavar="/A:=/B", help="Play a topic as another. Repeatable.")
    ] = None,
    clock: Annotated[
        float, typer.Option("--clock", min=0.0, max=10_000.0, metavar="HZ", help="Publish the time on /clock.")
    ] = 0.0,
    force: Annotated[bool, typer.Option("--force", help="Play although others publish the same topics.")] = False,
    connect: Endpoint = None,
    listen: Annotated[
        str | None,
        typer.Option("--listen", metavar="ENDPOINT", help="Endpoint to listen on if no server or router is running."),
    ] = None,
    zenoh_config: ZenohConfig = None,
) -> None:
    """Plays a bag: publishes its messages as a server does, also for ROS 2 nodes.

    Keys during the playback: space pauses and continues, right arrow plays the next message, up and down arrows change
    the rate.
    """
    from mjplug.bag.errors import require_mcap

    require_mcap()
    from mjplug.bag.reader import Bag
    from mjplug.errors import MjplugError, UnknownName
    from mjplug.player.outputs import NAME, Outputs, chosen_topics, refuse_live_publishers
    from mjplug.player.pace import Pace
    from mjplug.player.player import Player
    from mjplug.wire.network import open_network
    from mjplug.wire.rmw_zenoh.keys import RosSettings
    from mjplug.wire.session import SessionSettings

    renamed = _renamed(remap or [])
    names = {f"/{topic.removeprefix('/')}" for topic in topics or ()}
    drop = _regex(exclude)
    opened = Bag(bag)
    chosen = chosen_topics(
        opened,
        lambda name: (not names or name in names) and not (drop is not None and drop.search(name)),
    )
    everything = {topic.name for file in opened.summaries() for topic in file.topics.values()}
    for name in sorted((names | renamed.keys()) - everything):
        raise MjplugError(str(UnknownName("topic in the bag", name, sorted(everything))))
    if not chosen:
        raise MjplugError(f"{bag} contains no topic to play")
    ros2 = RosSettings(_domain())
    with EndingSignals() as signals, _keys(signals) as keys:
        player = Player(
            opened,
            frozenset(chosen),
            Pace(rate, start_paused),
            keys,
            loop,
            round(start_offset * 1e9),
            clock,
        )
        settings = SessionSettings(
            listen=None if listen is None else (listen,),
            connect=() if connect is None else (connect,),
            config=None if zenoh_config is None else Path(zenoh_config),
        )
        network = open_network(settings, NAME, ros2=ros2, now=player.now)
        try:
            if not force:
                played = {renamed.get(name, name): topic.type for name, topic in chosen.items()}
                if clock:
                    played["/clock"] = "rosgraph_msgs/msg/Clock"
                refuse_live_publishers(network.session.zenoh, ros2.domain_id, played)
            outputs = Outputs(network, chosen, renamed, clock > 0.0)
            for name, why in sorted(outputs.skipped.items()):
                complain(f"note: {name} is not played: {why}")
            count = len(chosen) - len(outputs.skipped)
            say(
                f"playing {count} {'topic' if count == 1 else 'topics'} of {bag} at {network.session.endpoint}"
                f"{'; paused' if start_paused else ''}"
            )
            if delay:
                signals.wait(delay)
            ended = player.run(outputs)
        finally:
            network.close()
    _say_end(player, ended)
    if not ended:
        raise typer.Exit(_TERMINATED if signals.last == signal.SIGTERM else _INTERRUPTED)


def _say_end(player: "Player", ended: bool) -> None:
    messages = "message" if player.played == 1 else "messages"
    say(f"played {player.played} {messages}{'' if ended else '; stopped before the end'}")
    if player.pace.delays:
        complain(f"warning: {player.pace.delays} times, messages were late by more than 0.2 s")


@contextlib.contextmanager
def _keys(signals: EndingSignals) -> "Iterator[Callable[[float], list[Key]]]":
    """Reads keys from the terminal, if there is one; the function waits and returns what the user did."""
    if not sys.stdin.isatty():

        def wait(timeout: float) -> "list[Key]":
            return ["stop"] if signals.wait(timeout) else []

        yield wait
        return
    from mjplug.cli.key_terminal import KeyTerminal

    with KeyTerminal() as terminal:

        def read(timeout: float) -> "list[Key]":
            text, arrived = terminal.read(timeout)
            if signal.SIGTSTP in arrived:
                terminal.suspend()
            elif arrived:
                signals.last = signal.SIGTERM if signal.SIGTERM in arrived else signal.SIGINT
                return ["stop"]
            return [_KEYS[key] for key in _KEY.findall(text) if key in _KEYS]

        yield read


def _renamed(pairs: list[str]) -> dict[str, str]:
    renamed = {}
    for pair in pairs:
        old, mark, new = pair.partition(":=")
        if not (old and mark and new):
            raise typer.BadParameter(f"{pair!r} has another form than /a:=/b", param_hint="--remap")
        renamed[f"/{old.removeprefix('/')}"] = f"/{new.removeprefix('/')}"
    return renamed


def _regex(text: str | None) -> "re.Pattern[str] | None":
    try:
        return None if text is None else re.compile(text)
    except re.error as error:
        raise typer.BadParameter(f"{text!r} is not a regular expression: {error}", param_hint="--exclude") from None


def _domain() -> int:
    text = os.environ.get("ROS_DOMAIN_ID", "") or "0"
    if not (text.isascii() and text.isdecimal() and int(text) <= 232):
        raise typer.BadParameter(f"ROS_DOMAIN_ID is {text!r}; it must be an integer from 0 to 232")
    return int(text)
