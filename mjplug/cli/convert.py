"""`mjplug convert`: turns a URDF or xacro file into a folder with an MJCF model and a configuration."""

from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from mjplug.cli.engine import import_mujoco, quick_imports
from mjplug.cli.interrupt import exit_on_interrupt
from mjplug.cli.output import complain, say, say_json
from mjplug.cli.received import is_topic, receive_description
from mjplug.cli.xacro_arguments import xacro_arguments

if TYPE_CHECKING:
    from mjplug.convert.conversion import Conversion
    from mjplug.convert.options import ConversionOptions


def convert(
    file: Annotated[
        Path, typer.Argument(metavar="FILE", help="A URDF or xacro file, or a topic: topic:/robot_description.")
    ],
    arguments: Annotated[
        list[str] | None,
        typer.Argument(metavar="[NAME:=VALUE]...", help="Arguments of a xacro file.", show_default=False),
    ] = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="FOLDER", help="The folder; default: the robot's name.")
    ] = None,
    base: Annotated[
        Literal["auto", "fixed", "free"], typer.Option(help="Whether the robot is fixed to the world.")
    ] = "auto",
    actuators: Annotated[
        Literal["auto", "position", "velocity", "motor", "none"], typer.Option(help="Kind of the actuators.")
    ] = "auto",
    collision: Annotated[str, typer.Option(metavar="urdf|visual[:LINKS]", help="Geometry that collides.")] = "urdf",
    decompose: Annotated[
        str,
        typer.Option(metavar="none|auto|all|LINK=THRESHOLD", help="Collision meshes to divide into convex parts."),
    ] = "none",
    self_collision: Annotated[
        Literal["auto", "all", "none"],
        typer.Option(help="Collisions between links; auto: not between links that always touch."),
    ] = "auto",
    srdf: Annotated[
        Path | None, typer.Option(metavar="FILE", help="An SRDF of MoveIt: disabled collisions and `home`.")
    ] = None,
    gravcomp: Annotated[
        Literal["auto", "on", "off"], typer.Option(help="Gravity compensation by the servos.")
    ] = "auto",
    scene: Annotated[
        str, typer.Option(metavar="NAME|FILE", help="floor, tabletop, obstacles, none, or an MJCF file.")
    ] = "",
    mujoco_inputs: Annotated[
        list[Path] | None,
        typer.Option("--mujoco-inputs", "-m", metavar="FILE", help="A file with <mujoco_inputs>. Repeatable."),
    ] = None,
    fuse: Annotated[bool, typer.Option("--fuse", help="Merge links behind fixed joints.")] = False,
    sites: Annotated[bool, typer.Option("--sites", help="Add a site for each link.")] = False,
    up_axis: Annotated[
        Literal["ignore", "apply"], typer.Option(help="Whether COLLADA meshes with Y_UP are turned; RViz ignores it.")
    ] = "ignore",
    max_faces: Annotated[
        int, typer.Option(min=0, help="Simplify visual meshes with more triangles; 0: never.")
    ] = 20_000,
    package: Annotated[
        list[str] | None, typer.Option(metavar="NAME=FOLDER", help="Folder of a ROS package. Repeatable.")
    ] = None,
    connect: Annotated[
        str | None,
        typer.Option(
            "--connect",
            "-e",
            metavar="ENDPOINT",
            envvar="MJPLUG_CONNECT",
            help="Zenoh endpoint of a router or server, for a topic.  [default: tcp/127.0.0.1:7447]",
        ),
    ] = None,
    timeout: Annotated[
        float, typer.Option(min=0.1, metavar="SECONDS", help="How long to wait for the message on a topic.")
    ] = 120.0,
    strict: Annotated[bool, typer.Option("--strict", help="Stop at a missing mesh.")] = False,
    force: Annotated[bool, typer.Option("--force", help="Replace the result of an earlier conversion.")] = False,
    check: Annotated[bool, typer.Option("--check", help="Report only; write nothing.")] = False,
    json: Annotated[bool, typer.Option("--json", help="Print the report as JSON.")] = False,
) -> None:
    """Converts a robot to MJCF: a folder with a scene, the robot, its meshes, and a configuration for `mjplug serve`.

    The report lists what was repaired and what was left out; conversion.json also contains every guessed value.
    """
    import_mujoco()
    with exit_on_interrupt(), quick_imports():
        from pydantic import ValidationError

        from mjplug.convert.cache import cache_folder
        from mjplug.convert.conversion import convert as run
        from mjplug.convert.folder import check_replaceable, write_folder
        from mjplug.convert.load import packages_for, received_packages
        from mjplug.convert.materials import free_name
        from mjplug.convert.options import ConversionOptions
        from mjplug.convert.received import read_received
        from mjplug.convert.source import read_source
        from mjplug.physics import process

    try:
        options = ConversionOptions(
            arguments=xacro_arguments(arguments or []),
            packages=_packages(package or []),
            base=base,
            actuators=actuators,
            collision=collision,
            decompose=decompose,
            self_collision=self_collision,
            srdf=str(srdf or ""),
            gravcomp=gravcomp,
            scene=scene,
            mujoco_inputs=tuple(map(str, mujoco_inputs or ())),
            fuse=fuse,
            sites=sites,
            up_axis=up_axis,
            max_faces=max_faces,
            strict=strict,
        )
    except ValidationError as error:
        first = error.errors()[0]
        name = str(first["loc"][0]).replace("_", "-")
        reason = first["msg"].removeprefix("Value error, ")
        raise typer.BadParameter(f"{first['input']!r}: {reason}", param_hint=f"--{name}") from None
    process.configure_mujoco()
    with exit_on_interrupt():
        if is_topic(str(file)):
            packages = received_packages(options, _environment())
            received = receive_description(str(file), connect, timeout)
            source = read_received(received, options.arguments, packages)
        else:
            packages = packages_for(file, options, _environment())
            source = read_source(file, options.arguments, packages)
        # A name can contain slashes, which must not lead to other folders.
        folder = output or Path(free_name((source.root.get("name") or file.name.partition(".")[0]).lstrip("./"), set()))
        if folder.exists() and not check:
            check_replaceable(folder, force)
        progress = _Progress()
        try:
            conversion = run(source, options, packages, cache_folder() / "parts", progress)
        finally:
            progress.clear()
        if not check:
            write_folder(folder, conversion.files, force)
    if json:
        say_json(_as_json(conversion, None if check else folder))
    else:
        _say_report(conversion, options)
        if not check:
            say(f"wrote {folder}; to run it: mjplug serve {folder / 'mjplug.yaml'}")


class _Progress:
    """A line with the stage and the time that is left; no output if standard error is not a terminal."""

    def __init__(self) -> None:
        import sys

        self._start = monotonic()
        self._stream = sys.stderr if sys.stderr is not None and sys.stderr.isatty() else None

    def __call__(self, stage: str, part: float) -> None:
        if self._stream is None:
            return
        elapsed = monotonic() - self._start
        left = f", about {elapsed / part - elapsed:.0f} s left" if part > 0.1 and elapsed > 2.0 else ""
        self._stream.write(f"\r\x1b[K{stage} ... {part:.0%}{left}")
        self._stream.flush()

    def clear(self) -> None:
        """Removes the line."""
        if self._stream is not None:
            self._stream.write("\r\x1b[K")
            self._stream.flush()


def _packages(given: list[str]) -> dict[str, str]:
    """Turns `NAME=FOLDER` into a mapping.

    Raises:
        BadParameter: It does not contain `=`.
    """
    result = {}
    for text in given:
        name, sign, folder = text.partition("=")
        if not (name and sign and folder):
            raise typer.BadParameter(f"{text!r} must be NAME=FOLDER", param_hint="--package")
        result[name] = folder
    return result


def _environment() -> dict[str, str]:
    import os

    return dict(os.environ)


def _say_report(conversion: "Conversion", options: "ConversionOptions") -> None:
    counts = conversion.counts
    kinds = {"position": "position servo", "velocity": "velocity servo", "motor": "motor"}
    parts = [
        _counted(counts["links"], "link"),
        _counted(counts["joints"], "moving joint"),
        *(_counted(counts[kind], name) for kind, name in kinds.items() if counts[kind]),
        *(_counted(counts[f"{name}s"], name) for name in ("sensor", "camera") if counts[f"{name}s"]),
        *([f"{counts['meshes']} mesh{'' if counts['meshes'] == 1 else 'es'}"] if counts["meshes"] else []),
        "free base" if conversion.free else "fixed base",
    ]
    for line in conversion.report.lines():
        complain(line)
    say(f"{conversion.name}: {', '.join(parts)}")
    guesses = len(conversion.report.of("guess"))
    if guesses:
        say(f"{_counted(guesses, 'value')} guessed, which the URDF does not contain; conversion.json lists them")


def _counted(count: int, what: str) -> str:
    return f"{count} {what}{'' if count == 1 else 's'}"


def _as_json(conversion: "Conversion", folder: Path | None) -> dict[str, object]:
    from json import loads

    from mjplug.convert.report import RECORD

    record = loads(conversion.files[RECORD])
    return {"folder": None if folder is None else str(folder), **record}
