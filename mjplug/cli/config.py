"""`mjplug config`: checks, shows and creates configuration files."""

from pathlib import Path
from typing import Annotated

import typer

from mjplug.cli.engine import import_mujoco
from mjplug.cli.examples import examples
from mjplug.cli.names import complete_model
from mjplug.cli.output import complain, complain_of, say

app = typer.Typer(name="config", help="Checks, shows and creates configuration files.", no_args_is_help=True)

Config = Annotated[
    str,
    typer.Argument(
        metavar="CONFIG",
        help="A configuration file, a ROS parameter file, or a model.",
        autocompletion=complete_model,
    ),
]
Model = Annotated[
    str | None,
    typer.Option(
        "--model",
        metavar="MODEL",
        help="The model to use instead of the one in the file.",
        autocompletion=complete_model,
    ),
]
Sets = Annotated[
    list[str] | None, typer.Option("--set", "-s", metavar="KEY=VALUE", help="Set any value, as for serve. Repeatable.")
]
Output = Annotated[
    Path | None, typer.Option("--output", "-o", metavar="FILE", help="Write to this file instead of standard output.")
]


@app.command()
def check(config: Config, model: Model = None, set_: Sets = None) -> None:
    """Checks a configuration with its model and plugins, as `serve --check` does."""
    from mjplug.cli.serve import serve

    serve(config, model=model, set_=set_, check=True)


@app.command()
def show(config: Config, model: Model = None, set_: Sets = None) -> None:
    """Shows every setting that is in effect, and where it comes from.

    The output is a valid configuration file.
    """
    import_mujoco()
    from mjplug.cli.config_effective import effective
    from mjplug.plugin.selection import select
    from mjplug.server.drafts import read_draft

    loaded, plugins = select(read_draft(config, model=model, sets=set_ or []))
    for warning in loaded.warnings:
        complain_of(warning)
    for line in effective(loaded, plugins):
        say(line)


@app.command(epilog=examples("mjplug config schema -o mjplug.schema.json"))
def schema(output: Output = None) -> None:
    """Writes the JSON Schema of configuration files, including the parameters of installed plugins.

    An editor with a YAML language server completes and checks a file whose first line is
    `# yaml-language-server: $schema=./mjplug.schema.json`.
    """
    import_mujoco()
    import json

    from mjplug.cli.config_schema import config_schema

    _write(json.dumps(config_schema(), indent=2), output)


@app.command(epilog=examples("mjplug config init scene.xml -o robot.yaml"))
def init(
    model: Annotated[str, typer.Argument(metavar="MODEL", help="The model to serve.", autocompletion=complete_model)],
    output: Output = None,
) -> None:
    """Writes a configuration file for a model: all settings with descriptions, and plugins that fit the model."""
    import_mujoco()
    from mjplug.cli.config_start import starting_file
    from mjplug.convert.load import load_model
    from mjplug.physics import process

    process.configure_mujoco()
    _write(starting_file(model, load_model(model).model), output)


@app.command(epilog=examples("mjplug config convert ros_params.yaml --model scene.xml -o robot.yaml"))
def convert(config: Config, model: Model = None, output: Output = None) -> None:
    """Converts a ROS parameter file into a configuration file."""
    import_mujoco()
    from mjplug.cli.config_convert import converted
    from mjplug.plugin.selection import select
    from mjplug.server.drafts import read_draft

    loaded, _ = select(read_draft(config, model=model, environ={}))
    for warning in loaded.warnings:
        complain_of(warning)
    _write(converted(loaded.settings), output)


def _write(text: str, output: Path | None) -> None:
    from mjplug.cli.new_files import write_file

    if output is None:
        say(text.rstrip("\n"))
        return
    write_file(output, f"{text.rstrip()}\n")
    complain(f"wrote {output}")
