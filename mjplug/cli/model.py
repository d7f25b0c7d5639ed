"""`mjplug model`: the elements of a model."""

from typing import Annotated, Literal

import typer

from mjplug.cli.engine import import_mujoco
from mjplug.cli.examples import examples
from mjplug.cli.names import complete_model
from mjplug.cli.output import say, say_json, say_table

app = typer.Typer(name="model", help="Shows the elements of a model.", no_args_is_help=True)


@app.command(epilog=examples("mjplug model info bundled:quadruped", "mjplug model info scene.xml joints"))
def info(
    model: Annotated[
        str,
        typer.Argument(
            metavar="MODEL",
            help="A model: .xml .mjb .urdf bundled:NAME package://...",
            autocompletion=complete_model,
        ),
    ],
    kind: Annotated[
        str | None,
        typer.Argument(
            metavar="KIND",
            help="Show only bodies, joints, actuators, sensors, sites, cameras, keyframes, or counts.",
        ),
    ] = None,
    output: Annotated[Literal["text", "json"], typer.Option("--output", "-o", help="Output format.")] = "text",
) -> None:
    """Shows bodies, joints, actuators, sensors, sites, cameras and keyframes of a model."""
    import_mujoco()
    from mjplug.cli.model_tables import TABLES, counts
    from mjplug.convert.load import load_model
    from mjplug.errors import did_you_mean
    from mjplug.physics import process

    if kind is not None and kind != "counts" and kind not in TABLES:
        raise typer.BadParameter(
            f"unknown kind {kind!r}{did_you_mean(kind, TABLES)}; known: counts, {', '.join(TABLES)}", param_hint="KIND"
        )
    process.configure_mujoco()
    loaded = load_model(model)
    tables = {name: table(loaded.model) for name, table in TABLES.items() if kind in (None, name)}
    if output == "json":
        content = {name: [dict(zip(rows[0], row, strict=True)) for row in rows[1:]] for name, rows in tables.items()}
        say_json({"name": loaded.name, "path": str(loaded.path), **counts(loaded.model), **content})
        return
    if kind in (None, "counts"):
        say(f"{loaded.name} ({loaded.path})")
        say_table((f"{name}:", _cell(value)) for name, value in counts(loaded.model).items())
    for name, rows in tables.items():
        if len(rows) > 1 or kind is not None:
            say(f"\n{name}" if kind is None else name)
            say_table([["  " + str(cell) if i == 0 else _cell(cell) for i, cell in enumerate(row)] for row in rows])


def _cell(value: object) -> str:
    if isinstance(value, list):
        return " ".join(_cell(item) for item in value)
    return f"{value:.4g}" if isinstance(value, float) else str(value)
