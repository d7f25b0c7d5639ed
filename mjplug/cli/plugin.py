"""`mjplug plugin`: the installed plugins and their parameters."""

from pathlib import Path
from typing import Annotated

import typer

from mjplug.cli.engine import import_mujoco
from mjplug.cli.examples import examples
from mjplug.cli.names import complete_plugin
from mjplug.cli.output import say

app = typer.Typer(name="plugin", help="Shows installed plugins, and creates new ones.", no_args_is_help=True)


@app.command("list")
def list_plugins() -> None:
    """Lists the installed plugins with their names and descriptions."""
    import_mujoco()
    from mjplug.plugin import PluginError, registry

    names: dict[str, list[str]] = {}
    for name, point in registry.registered().items():
        names.setdefault(point.value, []).append(name)
    rows = []
    for target, known_as in names.items():
        short, *aliases = sorted(known_as, key=lambda name: ("/" in name, name))
        try:
            summary = (registry.find(short).__doc__ or "(not documented)").strip().splitlines()[0]
        except PluginError as error:
            summary = f"(broken) {error}"
        rows.append((short, summary, target + "".join(f", also {alias}" for alias in aliases)))
    width = max((len(short) for short, _, _ in rows), default=0)
    for short, summary, target in rows:
        say(f"{short:<{width}}  {summary}")
        say(f"{'':<{width}}  {target}")


@app.command("info")
def info(
    type: Annotated[
        str,
        typer.Argument(
            help="A name from `mjplug plugin list`, or module:Class.", metavar="TYPE", autocompletion=complete_plugin
        ),
    ],
) -> None:
    """Shows the description of a plugin, and its parameters with types, defaults and units."""
    import_mujoco()
    from mjplug.cli.plugin_page import page
    from mjplug.plugin import registry

    for line in page(type, registry.find(type)):
        say(line)


@app.command("new", epilog=examples("mjplug plugin new lamp", "pip install ./lamp[test] && pytest lamp"))
def new(
    name: Annotated[
        str, typer.Argument(metavar="NAME", help="Name of the plugin, such as lamp: lower-case letters, digits and _.")
    ],
    into: Annotated[
        Path, typer.Option("--into", metavar="FOLDER", help="The folder in which to create the package.")
    ] = Path(),
) -> None:
    """Creates a package with a simple plugin and its test."""
    from mjplug.cli.plugin_new import write

    folder = write(name, into)
    say(f"wrote {folder}; try it:")
    say(f"  pip install -e '{folder}[test]'")
    say(f"  pytest {folder}")
    say(f"  mjplug serve bundled:box --plugin {name}")
