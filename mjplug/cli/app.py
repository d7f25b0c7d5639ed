"""The tree of commands, and what ends the process with which code."""

import sys
from importlib.metadata import version
from typing import Annotated

import typer

from mjplug.cli.plugin import app as plugin_app
from mjplug.cli.serve import serve
from mjplug.errors import ConfigError, MjplugError, ModelError, WireError

EXIT_CODES: tuple[tuple[type[MjplugError], int], ...] = (
    (ConfigError, 3),
    (ModelError, 4),
    (WireError, 5),
    (MjplugError, 1),
)
"""Exit codes by error, the most specific first; 0 is success, 2 a usage error."""

app = typer.Typer(
    name="mjplug",
    help="A MuJoCo simulation server that speaks Zenoh: ROS 2 topics and services, without ROS.",
    epilog="Exit codes: 0 ok, 1 failed, 2 usage, 3 configuration, 4 model, 5 network.",
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"]},
    pretty_exceptions_enable=False,
)
app.command()(serve)
app.add_typer(plugin_app)


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"mjplug {version('mjplug')}")
        raise typer.Exit


@app.callback()
def _root(
    show_version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Show the version.")
    ] = False,
) -> None:
    pass


def main() -> None:
    """Runs the command line; an error that mjplug raises on purpose is printed without a traceback."""
    try:
        app()
    except MjplugError as error:
        print(_text(error), file=sys.stderr)
        sys.exit(next(code for kind, code in EXIT_CODES if isinstance(error, kind)))


def _text(error: MjplugError) -> str:
    # A configuration error carries its own places, one per line.
    return str(error) if isinstance(error, ConfigError) else f"error: {error}"
