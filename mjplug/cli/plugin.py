"""`mjplug plugin`: which plugins there are, and what each takes."""

from typing import Annotated, Any

import typer

from mjplug.cli.engine import import_mujoco

app = typer.Typer(name="plugin", help="Shows the plugins that are installed.", no_args_is_help=True)


@app.command("list")
def list_plugins() -> None:
    """Lists every installed plugin: its names, and its first line of documentation."""
    import_mujoco()
    from mjplug.plugin import PluginError, registry

    names: dict[str, list[str]] = {}
    for name, point in registry.registered().items():
        names.setdefault(point.value, []).append(name)
    for target, known_as in names.items():
        short, *aliases = sorted(known_as, key=lambda name: ("/" in name, name))
        try:
            summary = (registry.find(short).__doc__ or "(not documented)").strip().splitlines()[0]
        except PluginError as error:
            summary = f"(broken) {error}"
        typer.echo(f"{short:<18} {summary}")
        typer.echo(f"{'':<18} {target}" + "".join(f", also {alias}" for alias in aliases))


@app.command("info")
def info(
    type: Annotated[str, typer.Argument(help="A name from `mjplug plugin list`, or module:Class.", metavar="TYPE")],
) -> None:
    """Shows what a plugin does and its parameters with types, defaults and units."""
    import_mujoco()
    from mjplug.plugin import registry

    plugin = registry.find(type)
    typer.echo(f"{plugin.__name__} ({plugin.__module__})\n")
    typer.echo(_dedent(plugin.__doc__ or ""))
    fields = plugin.parameters_type.model_fields
    typer.echo("\nParameters:" if fields else "\nNo parameters.")
    for name, field in fields.items():
        default = "required" if field.is_required() else f"default {_yaml(field.default)}"
        typer.echo(f"  {name} ({_type_name(field.annotation)}, {default})")
        typer.echo(f"      {field.description or ''}")
    instance = type.split("/")[-1].split(":")[-1].lower()
    typer.echo(f"\nIn a configuration file:\n\n  plugins:\n    {instance}:\n      type: {type}")
    for name, field in fields.items():
        typer.echo(f"      {name}: {'...' if field.is_required() else _yaml(field.default)}")


def _dedent(text: str) -> str:
    return "\n".join(line.strip() for line in text.strip().splitlines())


def _type_name(annotation: Any) -> str:
    return annotation.__name__ if isinstance(annotation, type) else str(annotation).replace("typing.", "")


def _yaml(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    return f'"{value}"' if isinstance(value, str) else str(value)
