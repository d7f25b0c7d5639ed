"""`mjplug bag`: shows, checks, repairs, cuts and exports bags."""

import json
import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from mjplug.cli.examples import examples
from mjplug.cli.output import complain, say, say_json, say_table

if TYPE_CHECKING:
    from mjplug.bag.reader import Bag

app = typer.Typer(
    name="bag",
    help="Shows, checks, recovers and cuts bags.",
    epilog=examples(
        "mjplug bag info run1",
        "mjplug bag check run1 && echo whole",
        "mjplug bag recover run1 -o run1_recovered",
        "mjplug bag cut run1 --start 10 --end 20 -o part",
    ),
    no_args_is_help=True,
)

BagPath = Annotated[Path, typer.Argument(metavar="BAG", help="Folder of a bag, or an MCAP file.")]
Output = Annotated[
    Path | None,
    typer.Option("--output", "-o", metavar="DIR", help="Folder to create. Default: the name of the bag with a suffix."),
]
Compression = Annotated[
    Literal["auto", "zstd", "lz4", "none"], typer.Option("--compression", help="Compression of the new bag.")
]


@app.command()
def info(
    bag: BagPath, json_output: Annotated[bool, typer.Option("--json", help="Show the information as JSON.")] = False
) -> None:
    """Shows duration, size, topics, types and counts of a bag."""
    about = _about(_open(bag))
    if json_output:
        say_json(about)
        return
    say(f"bag:       {about['path']} ({_size(about['bytes'])}, {_plural(len(about['files']), 'file')})")
    clock = {"sim": "simulated time", "wall": "wall time"}.get(str(about["clock"]), "")
    say(f"time:      {about['start']:.3f} s to {about['end']:.3f} s{f', {clock}' if clock else ''}")
    say(f"duration:  {about['duration']:.3f} s")
    say(f"messages:  {about['messages']}")
    if about["unfinished"]:
        say("state:     not completed; mjplug bag recover completes it")
    say()
    rows = [("topic", "type", "messages", "rate (Hz)", "lost")]
    for topic in about["topics"]:
        rate = "-" if topic["rate"] is None else f"{topic['rate']:.2f}"
        rows.append((topic["name"], topic["type"], str(topic["messages"]), rate, str(topic["lost"])))
    say_table(rows)
    if len(about["files"]) > 1:
        say()
        say_table(
            [
                ("file", "from (s)", "to (s)", "messages", "begins because"),
                *(
                    (f["name"], f"{f['start']:.3f}", f"{f['end']:.3f}", f["messages"], f["reason"] or "-")
                    for f in about["files"]
                ),
            ]
        )


@app.command()
def check(bag: BagPath) -> None:
    """Reads every message of a bag and compares checksums and indexes.

    The exit code is 1 if the bag is damaged.
    """
    opened = _open(bag)
    from mjplug.bag import repair

    problems = list(repair.check(opened))
    for problem in problems:
        complain(f"error: {problem}")
    if problems:
        complain(f"mjplug bag recover {bag} makes a bag of what can be read")
        raise typer.Exit(1)
    messages = sum(file.messages for file in opened.summaries())
    say(f"ok · {_plural(len(opened.files), 'file')}, {_plural(messages, 'message')}")


@app.command()
def recover(bag: BagPath, output: Output = None, compression: Compression = "auto") -> None:
    """Makes a complete bag of one whose recorder was killed, or which is damaged."""
    opened = _open(bag)
    from mjplug.bag import repair

    folder = output or _beside(bag, "recovered")
    result = repair.recover(opened, folder, compression)
    for file, why in result.damage.items():
        complain(f"note: {file}: read up to the damage: {why}")
    say(f"wrote {folder} with {_plural(result.messages, 'message')}")


@app.command()
def cut(
    bag: BagPath,
    start: Annotated[
        float, typer.Option("--start", min=0.0, metavar="SECONDS", help="First time, from the beginning of the bag.")
    ] = 0.0,
    end: Annotated[
        float | None,
        typer.Option("--end", min=0.0, metavar="SECONDS", help="Last time, from the beginning of the bag."),
    ] = None,
    output: Output = None,
    compression: Compression = "auto",
) -> None:
    """Makes a bag of a part of the time, with the latched messages from before."""
    import math

    if end is not None and end < start:
        raise typer.BadParameter(f"{end:g} is before --start {start:g}", param_hint="--end")
    _copy(bag, output or _beside(bag, "cut"), lambda name: True, start, math.inf if end is None else end, compression)


@app.command(name="filter")
def filter_(
    bag: BagPath,
    topics: Annotated[list[str] | None, typer.Argument(metavar="[TOPIC]...", help="Topics to keep.")] = None,
    regex: Annotated[
        str | None, typer.Option("--regex", "-e", metavar="REGEX", help="Keep topics whose names match.")
    ] = None,
    exclude: Annotated[
        str | None, typer.Option("--exclude", "-x", metavar="REGEX", help="Leave out topics whose names match.")
    ] = None,
    output: Output = None,
    compression: Compression = "auto",
) -> None:
    """Makes a bag of some of the topics."""
    from mjplug.errors import MjplugError, UnknownName

    keep, drop = _regex(regex, "--regex"), _regex(exclude, "--exclude")
    if not topics and keep is None and drop is None:
        raise typer.BadParameter("name topics, or give --regex or --exclude", param_hint="TOPIC")
    names = {f"/{topic.removeprefix('/')}" for topic in topics or ()}
    there = {topic.name for file in _open(bag).summaries() for topic in file.topics.values()}
    for name in sorted(names - there):
        raise MjplugError(str(UnknownName("topic", name, sorted(there))))

    def chosen(name: str) -> bool:
        if name in names:
            return True
        if drop is not None and drop.search(name):
            return False
        return keep.search(name) is not None if keep is not None else not names

    import math

    _copy(bag, output or _beside(bag, "filtered"), chosen, 0.0, math.inf, compression)


@app.command()
def export(
    bag: BagPath,
    topics: Annotated[list[str] | None, typer.Argument(metavar="[TOPIC]...", help="Topics. Default: all.")] = None,
    csv: Annotated[bool, typer.Option("--csv", help="Write CSV; the default.")] = False,
    parquet: Annotated[bool, typer.Option("--parquet", help="Write Parquet; needs the extra `parquet`.")] = False,
    output: Output = None,
    max_array: Annotated[
        int,
        typer.Option(
            "--max-array", min=0, metavar="COUNT", help="Leave out arrays with more elements, but their length."
        ),
    ] = 128,
) -> None:
    """Writes each topic as a table: one row per message, one column per number or text."""
    from mjplug.errors import MjplugError, UnknownName

    if csv and parquet:
        raise typer.BadParameter("choose one of --csv and --parquet", param_hint="--parquet")
    opened = _open(bag)
    from mjplug.bag import export as tables
    from mjplug.bag.errors import require_parquet

    if parquet:
        require_parquet()
    names = {f"/{topic.removeprefix('/')}" for topic in topics or ()}
    there = {topic.name for file in opened.summaries() for topic in file.topics.values()}
    for name in sorted(names - there):
        raise MjplugError(str(UnknownName("topic in the bag", name, sorted(there))))
    format: Literal["csv", "parquet"] = "parquet" if parquet else "csv"
    folder = output or _beside(bag, format)
    written = tables.export(opened, folder, lambda name: not names or name in names, format, max_array)
    for name, (path, count) in written.items():
        say(f"{path}: {_plural(count, 'row')} of {name}")


def _copy(bag: Path, folder: Path, chosen: Any, start: float, end: float, compression: Any) -> None:
    opened = _open(bag)
    from mjplug.bag import edit

    copied = edit.copy(opened, folder, chosen, start, end, compression)
    say(f"wrote {folder} with {_plural(copied, 'message')}")


def _open(path: Path) -> "Bag":
    from mjplug.bag.errors import require_mcap

    require_mcap()
    from mjplug.bag.reader import Bag

    return Bag(path)


def _about(bag: "Bag") -> dict[str, Any]:
    files = bag.summaries()
    filled = [file for file in files if file.messages]
    start = min((file.start for file in filled), default=0) / 1e9
    end = max((file.end for file in filled), default=0) / 1e9
    lost: dict[str, int] = {}
    for file in files:
        for kind in ("lost", "dropped"):
            for name, count in _counts(file.result.get(kind, "")).items():
                lost[name] = lost.get(name, 0) + count
    topics: dict[str, dict[str, Any]] = {}
    for file in files:
        for channel, topic in file.topics.items():
            entry = topics.setdefault(
                topic.name, {"name": topic.name, "type": topic.type, "messages": 0, "lost": lost.get(topic.name, 0)}
            )
            entry["messages"] += file.counts.get(channel, 0)
    for entry in topics.values():
        entry["rate"] = entry["messages"] / (end - start) if end > start and entry["messages"] > 1 else None
    return {
        "path": str(bag.path),
        "bytes": sum(file.path.stat().st_size for file in files),
        "clock": next((file.about["clock"] for file in files if "clock" in file.about), ""),
        "start": start,
        "end": end,
        "duration": end - start,
        "messages": sum(file.messages for file in files),
        "unfinished": bag.open or any(not file.finished for file in files),
        "topics": [topics[name] for name in sorted(topics)],
        "files": [
            {
                "name": file.path.name,
                "start": file.start / 1e9,
                "end": file.end / 1e9,
                "messages": file.messages,
                "epoch": file.about.get("epoch", ""),
                "reason": file.about.get("begins because", ""),
                "attachments": file.attachments,
                "damage": file.damage,
            }
            for file in files
        ],
    }


def _counts(text: str) -> dict[str, int]:
    """Returns numbers by topic from a metadata record; empty if it contains none."""
    try:
        return {str(name): int(count) for name, count in json.loads(text).items()}
    except (ValueError, TypeError, AttributeError):
        return {}


def _regex(text: str | None, flag: str) -> "re.Pattern[str] | None":
    try:
        return None if text is None else re.compile(text)
    except re.error as error:
        raise typer.BadParameter(f"{text!r} is not a regular expression: {error}", param_hint=flag) from None


def _beside(bag: Path, suffix: str) -> Path:
    resolved = bag.resolve()
    return resolved.parent / f"{resolved.stem}_{suffix}"


def _plural(count: int, noun: str) -> str:
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def _size(count: float) -> str:
    for unit in ("B", "KB", "MB"):
        if count < 1000.0:
            return f"{count:.0f} B" if unit == "B" else f"{count:.1f} {unit}"
        count /= 1000.0
    return f"{count:.1f} GB"
