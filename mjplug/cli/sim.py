"""`mjplug sim`: controls a running simulation."""

import time
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from mjplug.cli.connected import connected
from mjplug.cli.names import complete_keyframe_of_server, complete_state
from mjplug.cli.output import say, say_json, say_table

if TYPE_CHECKING:
    from mjplug.client import Client, ServerInfo

app = typer.Typer(
    name="sim", help="Pauses, steps and resets the simulation, sets its speed, saves its state.", no_args_is_help=True
)

_NAME_HELP = "Name of the state: letters, digits and underscores."
Name = Annotated[str, typer.Argument(metavar="NAME", help=_NAME_HELP)]
SavedName = Annotated[str, typer.Argument(metavar="NAME", help=_NAME_HELP, autocompletion=complete_state)]
InFile = Annotated[
    bool, typer.Option("--file", "-f", help="In a file on the machine of the server, instead of its memory.")
]

_MEASURE = 0.5
"""Wall time over which the speed is measured [s]."""

_ANSWER_TIMEOUT = 5.0
"""Timeout of messages and responses that describe the server [s]."""


@app.command()
@connected
def state(
    client: "Client",
    output: Annotated[Literal["text", "json"], typer.Option("--output", "-o", help="Output format.")] = "text",
) -> None:
    """Shows model, state, simulated time, speed, contacts and resets."""
    from mjplug.client.parameters import read

    server = client.server
    parameters = read(client.session, server.name)
    paused = parameters.get("sim.paused")
    seconds, measured = _clock(client, server, 0.0 if paused else _MEASURE)
    values = {
        "server": server.name,
        "version": server.version,
        "endpoint": server.endpoint,
        "model": parameters.get("model"),
        "state": "paused" if paused else "running",
        "time": seconds,
        "speed": parameters.get("sim.speed"),
        "measured_speed": None if paused else round(measured, 3),
        "contacts": int(_diagnostics(client, server)[1]["contacts"]),
        "resets": client.subscribe(f"{server.name}/epoch").next(_ANSWER_TIMEOUT).data,
    }
    if output == "json":
        say_json(values)
        return
    factor = "" if paused else f" (measured: {measured:.3g})"
    say_table(
        [
            ("server:", f"{values['server']} at {values['endpoint']}, mjplug {values['version']}"),
            ("model:", values["model"]),
            ("state:", values["state"]),
            ("time:", f"{seconds:.3f} s"),
            ("speed:", f"{_number(values['speed'])}{factor}"),
            ("contacts:", values["contacts"]),
            ("resets:", values["resets"]),
        ]
    )


@app.command()
@connected
def pause(client: "Client") -> None:
    """Pauses the simulation."""
    say(client.call("~/set_pause", paused=True).message)


@app.command()
@connected
def resume(client: "Client") -> None:
    """Resumes the simulation."""
    say(client.call("~/set_pause", paused=False).message)


@app.command()
@connected
def step(
    client: "Client",
    steps: Annotated[int, typer.Argument(min=1, metavar="STEPS", help="Number of steps.")] = 1,
    timeout: Annotated[
        float | None,
        typer.Option(
            "--timeout", min=0.0, metavar="SECONDS", help="How long to wait.  [default: 10 s plus 1 ms per step]"
        ),
    ] = None,
) -> None:
    """Takes steps as fast as possible; the simulation must be paused."""
    say(client.call("~/step_simulation", timeout=timeout, steps=steps).message)


@app.command()
@connected
def reset(
    client: "Client",
    keyframe: Annotated[
        str,
        typer.Option(
            "--keyframe",
            "-k",
            help="Reset to this keyframe of the model: its name or index.",
            autocompletion=complete_keyframe_of_server,
        ),
    ] = "",
) -> None:
    """Resets the world to its initial state, or to a keyframe.

    Simulated time continues.
    """
    say(client.call("~/reset_world", keyframe=keyframe).message)


# So that -1 is a value and not a flag, and the server explains why it is refused.
@app.command(context_settings={"ignore_unknown_options": True})
@connected
def speed(
    client: "Client",
    factor: Annotated[
        str | None, typer.Argument(metavar="FACTOR|max", help="The new speed. Default: show the current speed.")
    ] = None,
) -> None:
    """Shows or sets the speed: simulated seconds per second of wall time."""
    from mjplug.client.parameters import read, set_one

    server = client.server.name
    if factor is not None:
        try:
            wanted: Any = factor if factor == "max" else float(factor)
        except ValueError:
            raise typer.BadParameter(f"{factor!r} is neither a number nor max", param_hint="FACTOR") from None
        set_one(client, server, "sim.speed", wanted)
    say(_number(read(client.session, server).get("sim.speed")))


@app.command()
@connected
def save(
    client: "Client",
    name: Name,
    file: InFile = False,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace a state of the same name.")] = False,
) -> None:
    """Saves the state of the simulation with its plugins."""
    say(client.call("~/save_state", {"name": name, "file": file, "overwrite": overwrite}).message)


@app.command()
@connected
def restore(
    client: "Client",
    name: SavedName,
    file: InFile = False,
    strict: Annotated[
        bool, typer.Option("--strict", help="Refuse if the state of a plugin cannot be restored.")
    ] = False,
    keep_time: Annotated[bool, typer.Option("--keep-time", help="Let simulated time continue.")] = False,
) -> None:
    """Restores a saved state; by default, simulated time is that of the state."""
    request = {"name": name, "file": file, "strict": strict, "keep_time": keep_time}
    say(client.call("~/restore_state", request).message)


@app.command()
@connected
def states(
    client: "Client",
    output: Annotated[Literal["text", "json"], typer.Option("--output", "-o", help="Output format.")] = "text",
) -> None:
    """Lists the saved states."""
    answer = client.call("~/list_states")
    found = [
        {
            "name": one.name,
            "where": "file" if one.file else "memory",
            "step": one.step,
            "time": _seconds(one.stamp),
            "size": one.size,
            "digest": one.digest,
            "left_out": list(one.left_out),
        }
        for one in answer.snapshots
    ]
    if output == "json":
        say_json(found)
        return
    if found:
        heads = ("name", "where", "step", "time", "size", "digest")
        rows = [
            (one["name"], one["where"], one["step"], f"{one['time']:.3f} s", one["size"], one["digest"][:12])
            for one in found
        ]
        say_table([heads, *rows])
    if not found or answer.message.startswith("invalid"):
        say(answer.message)


@app.command("delete-state")
@connected
def delete_state(client: "Client", name: SavedName, file: InFile = False) -> None:
    """Deletes a saved state."""
    say(client.call("~/delete_state", {"name": name, "file": file}).message)


def _clock(client: "Client", server: "ServerInfo", span: float) -> tuple[float, float]:
    """Returns a server's simulated time [s], and its speed over a span of wall time [s]."""
    topic = _own_clock(client, server)
    if topic is None:
        return _last_second(client, server)
    with client.subscribe(topic, depth=1) as clock:
        first, begin = _seconds(clock.next(_ANSWER_TIMEOUT).clock), time.monotonic()
        last, end = first, begin
        while end - begin < span:
            last, end = _seconds(clock.next(_ANSWER_TIMEOUT).clock), time.monotonic()
    return last, (last - first) / (end - begin) if end > begin else 0.0


def _own_clock(client: "Client", server: "ServerInfo") -> str | None:
    """Returns the topic of a server's clock; None if other servers publish it too."""
    from mjplug_schemas.rosgraph_msgs import Clock

    clocks = (topic for topic in client.topics().values() if topic.type == Clock.TYPE)
    return next((topic.name for topic in clocks if topic.publishers == (server.name,)), None)


def _last_second(client: "Client", server: "ServerInfo") -> tuple[float, float]:
    """Returns simulated time [s] and speed during the last second, from the diagnostics of a server."""
    seconds, values = _diagnostics(client, server)
    return seconds, float(values["real-time factor"])


def _diagnostics(client: "Client", server: "ServerInfo") -> tuple[float, dict[str, str]]:
    """Returns the simulated time [s] of a server's diagnostics, and the values of the simulation by name."""
    from mjplug_schemas.diagnostic_msgs import DiagnosticArray

    message = DiagnosticArray.from_json(client.call(f"{server.name}/get_diagnostics", timeout=_ANSWER_TIMEOUT).message)
    simulation = (status for status in message.status if status.name.endswith(": simulation"))
    values = {value.key: value.value for status in simulation for value in status.values}
    return _seconds(message.header.stamp), values


def _seconds(stamp: Any) -> float:
    return float(stamp.sec + stamp.nanosec / 1e9)


def _number(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)
