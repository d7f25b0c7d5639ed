"""`mjplug record`: records topics into a bag."""

import contextlib
import re
import signal
import sys
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from mjplug.cli.connected import connected
from mjplug.cli.ending import EndingSignals
from mjplug.cli.names import complete_topic
from mjplug.cli.output import complain, say

if TYPE_CHECKING:
    from mjplug.client import Client
    from mjplug.recorder.recorder import Recorder

_REPORT_AFTER = 2.0
"""Time after which selected topics without messages are named [s]."""

_TIME_TIMEOUT = 10.0
"""How long to wait for topics and simulated time at the start [s]. A server on a busy machine may need seconds."""

_SWITCH_INTERVAL = 5e-4
"""Time after which Python gives the interpreter to a thread that waits [s]: Zenoh's thread, which must take messages
before the link is full. Python's default of 5 ms is a third of the time between two images at 60 Hz."""

_PROGRESS_INTERVAL = 1.0
"""Interval of the progress line [s]."""

Compression = Literal["auto", "zstd", "lz4", "none"]


def _regex(text: str | None, flag: str) -> "re.Pattern[str] | None":
    try:
        return None if text is None else re.compile(text)
    except re.error as error:
        raise typer.BadParameter(f"{text!r} is not a regular expression: {error}", param_hint=flag) from None


@partial(connected, short_e=True)
def record(
    client: "Client",
    topics: Annotated[
        list[str] | None,
        typer.Argument(metavar="[TOPIC]...", help="Topics to record.", autocompletion=complete_topic),
    ] = None,
    all: Annotated[bool, typer.Option("--all", "-a", help="Record all topics, except hidden ones.")] = False,
    regex: Annotated[
        str | None, typer.Option("--regex", "-e", metavar="REGEX", help="Record topics whose names match.")
    ] = None,
    exclude: Annotated[
        str | None, typer.Option("--exclude", "-x", metavar="REGEX", help="Leave out topics whose names match.")
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="DIR", help="Folder to create. Default: mjplug_ and the time."),
    ] = None,
    compression: Annotated[
        Compression,
        typer.Option("--compression", help="auto: zstd, except for messages that are compressed already."),
    ] = "auto",
    max_bag_size: Annotated[
        int,
        typer.Option("--max-bag-size", "-b", min=0, metavar="BYTES", help="Begin a new file at this size; 0: never."),
    ] = 0,
    max_bag_duration: Annotated[
        float,
        typer.Option(
            "--max-bag-duration", "-d", min=0.0, metavar="SECONDS", help="Begin a new file after this time; 0: never."
        ),
    ] = 0.0,
    clock: Annotated[
        Literal["sim", "wall"], typer.Option("--clock", help="Time axis of the bag: simulated time or wall time.")
    ] = "sim",
    max_cache_size: Annotated[
        int,
        typer.Option(
            "--max-cache-size", min=1 << 20, metavar="BYTES", help="Maximum size of messages that wait for the disk."
        ),
    ] = 512 << 20,
    start_paused: Annotated[
        bool, typer.Option("--start-paused", help="Wait for the space key before recording.")
    ] = False,
    duration: Annotated[
        float | None, typer.Option("--duration", min=0.0, metavar="SECONDS", help="Stop after this wall time.")
    ] = None,
) -> None:
    """Records topics into a bag until Ctrl-C.

    A bag is a folder of MCAP files in the layout of rosbag2.
    """
    from mjplug.bag.errors import require_mcap

    require_mcap()
    from mjplug.bag.writer import BagWriter, Limits
    from mjplug.recorder.recorder import Recorder
    from mjplug.recorder.selection import Selection

    if not (topics or all or regex):
        raise typer.BadParameter("name topics, or give --all or --regex", param_hint="TOPIC")
    names = frozenset(client.resolve(topic) for topic in topics or ())
    selection = Selection(all, names, _regex(regex, "--regex"), _regex(exclude, "--exclude"))
    if start_paused and not sys.stdin.isatty():
        raise typer.BadParameter("it needs a terminal, where the space key is pressed", param_hint="--start-paused")
    folder = output or Path(time.strftime("mjplug_%Y_%m_%d-%H_%M_%S"))
    limits = Limits(max_bag_size, round(max_bag_duration * 1e9))
    bag = BagWriter(folder, compression, limits, {"clock": clock})
    sys.setswitchinterval(_SWITCH_INTERVAL)
    with EndingSignals() as signals:
        recorder = Recorder(client.session, bag, selection, clock, max_cache_size, _notice)
        recorder.paused = start_paused
        _run(client, recorder, signals, duration)


def _run(client: "Client", recorder: "Recorder", signals: EndingSignals, duration: float | None) -> None:
    """Records until a signal or the end of `duration`, and completes the bag."""
    from mjplug.bag.errors import BagError

    failure: BagError | None = None
    known = recorder.wait_for_time(_TIME_TIMEOUT)
    if not known:
        complain("warning: no simulated time is known: messages without a time of their own are recorded at 0 s")
    say(f"recording into {recorder.bag.folder}; Ctrl-C ends it{'; paused' if recorder.paused else ''}")
    began = time.monotonic()
    try:
        with _keys(recorder) as pressed:
            progress = _Progress(recorder)
            reported = False
            while not signals.count and (duration is None or time.monotonic() - began < duration):
                recorder.turn()
                if pressed():
                    break
                now = time.monotonic()
                progress.show(now)
                if not reported and now - began >= _REPORT_AFTER:
                    reported = True
                    _name_missing(client, recorder)
            recorder.stop()
            before = signals.count
            # A second signal gives up what is still waiting.
            while recorder.backlog.size and signals.count <= before:
                recorder.turn(0.0)
            progress.end()
    except BagError as error:
        failure = error
    finally:
        recorder.stop()
    discarded = len(recorder.backlog.clear())
    try:
        recorder.finish()
    except BagError as error:
        failure = failure or error
    _say_summary(recorder, discarded)
    if failure is not None:
        raise failure


@contextlib.contextmanager
def _keys(recorder: "Recorder") -> Iterator[Callable[[], bool]]:
    """Reads the keys of the terminal, if there is one; the value returns whether to stop."""
    if not sys.stdin.isatty():
        yield lambda: False
        return
    from mjplug.cli.key_terminal import KeyTerminal

    with KeyTerminal() as terminal:

        def pressed() -> bool:
            text, signals = terminal.read(0.0)
            if signal.SIGTSTP in signals:
                terminal.suspend()
            elif signals:
                return True
            if text.count(" ") % 2:
                recorder.paused = not recorder.paused
                say("paused" if recorder.paused else "recording")
            return False

        yield pressed


class _Progress:
    """The line with the progress on a terminal, once a second."""

    def __init__(self, recorder: "Recorder") -> None:
        self._recorder = recorder
        self._shown = sys.stderr.isatty()
        self._began = self._last = time.monotonic()
        self._bytes = 0

    def show(self, now: float) -> None:
        """Shows the line if it is due."""
        if not self._shown or now - self._last < _PROGRESS_INTERVAL:
            return
        recorder = self._recorder
        size = recorder.bag.total_size
        rate = (size - self._bytes) / (now - self._last)
        self._bytes, self._last = size, now
        sys.stderr.write(
            f"\r\033[K{now - self._began:.0f} s  {recorder.total('written')} messages  {_size(size)}  "
            f"{_size(rate)}/s  lost {recorder.total('lost')}  dropped {recorder.total('dropped')}  "
            f"waiting {_size(recorder.backlog.size)}  file {recorder.bag.files}"
        )
        sys.stderr.flush()

    def end(self) -> None:
        """Ends the line."""
        if self._shown:
            sys.stderr.write("\r\033[K")
            sys.stderr.flush()


def _notice(text: str) -> None:
    complain(f"note: {text}")


def _name_missing(client: "Client", recorder: "Recorder") -> None:
    """Names the selected topics that no server has, and those without messages."""
    from mjplug.cli.silence import why_silent
    from mjplug.client import ClientError
    from mjplug.errors import did_you_mean

    try:
        offered = client.topics()
    except ClientError as error:
        complain(f"warning: {error}")
        return
    for name in recorder.missing():
        complain(
            f"warning: no server has the topic {name}{did_you_mean(name, list(offered))}; it is recorded if one appears"
        )
    for recorded in list(recorder.topics.values()):
        if recorded.wanted and not recorded.written and not recorder.paused:
            why = why_silent(client, recorded.topic.name) if recorded.source.published else "no program has published"
            complain(f"note: no messages on {recorded.topic.name} yet: {why}")


def _say_summary(recorder: "Recorder", discarded: int) -> None:
    """Prints what is in the bag and what is not."""
    filled = sum(topic.written > 0 for topic in recorder.topics.values())
    say(
        f"recorded {recorder.total('written')} messages of {filled} topics "
        f"in {recorder.bag.folder} ({_size(recorder.bag.total_size)}, {recorder.bag.files} "
        f"{'file' if recorder.bag.files == 1 else 'files'})"
    )
    for name, topic in sorted(recorder.topics.items()):
        if not topic.wanted:
            continue
        parts = []
        if topic.gaps.lost:
            parts.append(f"{topic.gaps.lost} lost on the way")
        if topic.dropped:
            parts.append(f"{topic.dropped} dropped because the disk was too slow")
        if topic.unreadable:
            parts.append(f"{topic.unreadable} not of type {topic.topic.type}")
        if parts:
            complain(f"warning: {name}: {', '.join(parts)}")
        elif not topic.written:
            complain(f"note: {name}: no messages")
        elif not topic.gaps.known:
            complain(f"note: {name}: its publisher sends no sequence numbers, so losses are unknown")
    for name in recorder.missing():
        complain(f"warning: {name}: no server had this topic")
    if discarded:
        complain(f"warning: {discarded} messages that waited for the disk were given up")


def _size(count: float) -> str:
    for unit in ("B", "KB", "MB"):
        if count < 1000.0:
            return f"{count:.0f} B" if unit == "B" else f"{count:.1f} {unit}"
        count /= 1000.0
    return f"{count:.1f} GB"
