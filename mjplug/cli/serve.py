"""`mjplug serve`: runs a server with a configuration file or a model."""

import json
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mjplug.cli.engine import import_mujoco, quick_imports
from mjplug.cli.interrupt import exit_on_interrupt
from mjplug.cli.names import complete_keyframe, complete_model, complete_plugin
from mjplug.cli.output import say
from mjplug.cli.xacro_arguments import xacro_arguments
from mjplug.config.problem import ConfigError
from mjplug.errors import MjplugError
from mjplug.lifecycle.ending import QuickEnd
from mjplug.lifecycle.watchdog import StopWatchdog
from mjplug.limits import MAX_SIMULATED_TIME
from mjplug.log import logging_to_stderr

if TYPE_CHECKING:
    from mjplug.config.load import Option


def serve(
    config: Annotated[
        str,
        typer.Argument(
            metavar="CONFIG|MODEL",
            help="A configuration file, a ROS parameter file (with --model), or a model: "
            ".xml .mjb .urdf .xacro bundled:NAME package://... topic:/robot_description",
            autocompletion=complete_model,
        ),
    ],
    arguments: Annotated[
        list[str] | None,
        typer.Argument(metavar="[NAME:=VALUE]...", help="Arguments of a xacro file.", show_default=False),
    ] = None,
    model: Annotated[
        str | None, typer.Option(help="The model, instead of the one in the file.", autocompletion=complete_model)
    ] = None,
    paused: Annotated[bool, typer.Option("--paused", help="Start paused.")] = False,
    keyframe: Annotated[
        str | None,
        typer.Option(
            help="Start from this keyframe of the model: its name or index.", autocompletion=complete_keyframe
        ),
    ] = None,
    speed: Annotated[str | None, typer.Option(metavar="FACTOR|max", help="Real-time factor, or max.")] = None,
    listen: Annotated[
        list[str] | None,
        typer.Option("--listen", "-l", help="Zenoh endpoint to listen on; port 0 means any free port. Repeatable."),
    ] = None,
    connect: Annotated[
        list[str] | None, typer.Option("--connect", "-e", help="Zenoh endpoint to connect to. Repeatable.")
    ] = None,
    plugin: Annotated[
        list[str] | None,
        typer.Option(
            "--plugin",
            "-p",
            metavar="TYPE[:NAME]",
            help="Add a plugin with default parameters. Repeatable.",
            autocompletion=complete_plugin,
        ),
    ] = None,
    zenoh_config: Annotated[
        str | None,
        typer.Option(
            "--zenoh-config",
            metavar="FILE",
            help="A Zenoh configuration file: certificates, roles, passwords and so on.",
        ),
    ] = None,
    set_: Annotated[
        list[str] | None,
        typer.Option("--set", "-s", metavar="KEY=VALUE", help="Set any setting, e.g. sim.clock_rate=50. Repeatable."),
    ] = None,
    scene: Annotated[
        str | None,
        typer.Option(
            metavar="NAME|FILE",
            help="Scene around the robot: floor, tabletop, obstacles, none, or an MJCF file.",
        ),
    ] = None,
    duration: Annotated[
        float | None, typer.Option(min=0.0, metavar="SECONDS", help="Stop after this simulated time.")
    ] = None,
    check: Annotated[
        bool, typer.Option("--check", help="Check configuration, model and plugins, without a network, and exit.")
    ] = False,
    ready_file: Annotated[
        Path | None,
        typer.Option(
            metavar="PATH",
            help="Write this file when services answer (JSON: endpoint, server, pid); remove it at the end.",
        ),
    ] = None,
    view: Annotated[
        int | None,
        typer.Option(
            "--view",
            metavar="[PORT]",
            min=0,
            max=65535,
            help="Show the simulation in a browser on this machine: http://127.0.0.1:8080, or the next free port.",
        ),
    ] = None,
    verbose: Annotated[
        int, typer.Option("--verbose", "-v", count=True, show_default=False, help="Log more. Repeatable.")
    ] = 0,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Log warnings and errors only.")] = False,
) -> None:
    """Simulates a model, and publishes it over Zenoh.

    Options such as --set override environment variables (MJPLUG_SIM__SPEED=2), which override CONFIG.
    """
    ending = QuickEnd()
    # Imported here, so that `mjplug --help` is quick.
    import_mujoco()
    with exit_on_interrupt(), quick_imports():
        from mjplug.cli.exit_codes import exit_code
        from mjplug.config.load import Option
        from mjplug.lifecycle import serve as lifecycle
        from mjplug.lifecycle.view_process import check_view
        from mjplug.server.drafts import read_draft
        from mjplug.server.prepared import check as check_start
        from mjplug.server.prepared import prepare

    if duration is not None and not duration <= MAX_SIMULATED_TIME:
        raise typer.BadParameter(
            f"it must be at most {MAX_SIMULATED_TIME} s, not {duration:g}", param_hint="--duration"
        )
    sets = [*_plugins(plugin or []), *_xacro_options(arguments or []), *(set_ or [])]
    sets += [Option(f"--scene {scene}", f"model_options.scene={json.dumps(scene)}")] if scene is not None else []
    sets += [Option("--paused", "sim.paused=true")] if paused else []
    # In quotes, so that a name such as `1` or `on` remains text.
    sets += [Option(f"--keyframe {keyframe}", f"sim.keyframe={json.dumps(keyframe)}")] if keyframe is not None else []
    sets += [Option(f"--speed {speed}", f"sim.speed={speed}")] if speed is not None else []
    sets += [_endpoints("listen", listen)] if listen else []
    sets += [_endpoints("connect", connect)] if connect else []
    sets += [_zenoh_config(zenoh_config)] if zenoh_config is not None else []
    if view is not None:
        check_view()
    verbosity = -1 if quiet else verbose
    if check:
        with logging_to_stderr(verbosity), closing(prepare(read_draft(config, model=model, sets=sets))) as prepared:
            check_start(prepared)
        # After the block, so that it is the last line.
        say(f"ok · {prepared.summary}")
        return
    with logging_to_stderr(verbosity):
        draft = read_draft(config, model=model, sets=sets)
        watchdog = StopWatchdog()
        watchdog.start()
        try:
            lifecycle.serve(prepare(draft), duration, watchdog, ready_file, typer.echo, view)
            ending.code = 0
        except MjplugError as error:
            ending.code = exit_code(error)
            raise
        finally:
            # The end of Python is limited too, because it waits for threads that plugins have started.
            watchdog.begin()


def _endpoints(name: str, given: list[str]) -> "Option":
    from mjplug.config.load import Option

    return Option(" ".join(f"--{name} {endpoint}" for endpoint in given), f"zenoh.{name}={json.dumps(given)}")


def _zenoh_config(file: str) -> "Option":
    from mjplug.config.load import Option

    # Absolute, because a relative path in the configuration is relative to the folder of its file.
    return Option(f"--zenoh-config {file}", f"zenoh.config={json.dumps(str(Path(file).resolve()))}")


def _xacro_options(given: list[str]) -> "list[Option]":
    from mjplug.config.load import Option

    arguments = xacro_arguments(given)
    return [
        Option(f"{name}:={value}", f"model_options.arguments.{name}={json.dumps(value)}")
        for name, value in arguments.items()
    ]


def _plugins(wanted: list[str]) -> "list[str | Option]":
    """Turns `--plugin TYPE[:NAME]` into `--set plugins.NAME.type=TYPE`.

    Raises:
        BadParameter: Two plugins have the same name.
    """
    from mjplug.config.load import Option
    from mjplug.config.problem import Mark, Problem, Source
    from mjplug.plugin.registry import registered
    from mjplug_schemas.errors import NameRuleError
    from mjplug_schemas.names import validate_node_name

    sets: dict[str, str | Option] = {}
    for text in wanted:
        kind, colon, name = text.rpartition(":")
        # In module:Class the colon belongs to the type; a class begins with a capital letter, an instance rarely does.
        if not colon or (kind not in registered() and ":" not in kind and name[:1].isupper()):
            kind, name = text, text.replace(":", "/").split("/")[-1]
        try:
            validate_node_name(name)
        except NameRuleError as error:
            raise ConfigError([Problem(str(error), Mark(Source(f"--plugin {text}")))]) from error
        if name in sets:
            raise typer.BadParameter(
                f"two plugins have the name {name!r}; give one another name: --plugin {kind}:NAME",
                param_hint="--plugin",
            )
        sets[name] = Option(f"--plugin {text}", f"plugins.{name}.type={json.dumps(kind)}")
    return list(sets.values())
