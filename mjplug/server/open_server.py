"""`mjplug.open_server`: opens a server in this process."""

import os
from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import Literal

from mjplug.errors import MjplugError
from mjplug.limits import MAX_SIMULATED_TIME
from mjplug.log_scope import LogScope
from mjplug.server.arguments import ConfigSource, PluginEntries, draft_of
from mjplug.server.prepared import prepare
from mjplug.server.running import RunningServer


def open_server(
    config: ConfigSource,
    *,
    model: str | os.PathLike[str] | None = None,
    plugins: PluginEntries | Iterable[str] = (),
    paused: bool | None = None,
    speed: float | Literal["max"] | None = None,
    keyframe: str | int | None = None,
    listen: str | Sequence[str] | None = None,
    connect: str | Sequence[str] | None = None,
    zenoh_config: str | os.PathLike[str] | None = None,
    settings: Mapping[str, object] = MappingProxyType({}),
    environ: Mapping[str, str] = os.environ,
    duration: float | None = None,
    run: bool = True,
) -> RunningServer:
    """Opens a server in this process, as `mjplug serve` does in a separate process.

    The arguments have the names and meanings of the command's options. They outrank environment variables such as
    `MJPLUG_SIM__SPEED`, which outrank the configuration.

    Unless `listen`, `connect`, `zenoh_config` or the configuration says otherwise, the server listens on a free port of
    127.0.0.1, so that any number of servers can be open at the same time. `mjplug serve` listens on port 7447 instead.

    Args:
        config: A configuration file, a ROS parameter file (with `model`), a model (`scene.xml`, `bundled:box`), or what
            a configuration file contains as a mapping. Relative paths in a mapping are relative to the current folder.
        model: The model, instead of the one in the configuration.
        plugins: Plugins to add. A list contains types; each instance is named after its type. A mapping contains, by
            instance name, the type, the class, or `{"type": ..., parameters}` as in a configuration file.
        paused: Whether to start paused.
        speed: Real-time factor from 0.001 to 1000, or `"max"`.
        keyframe: Name or index of the model's keyframe to start from.
        listen: Zenoh endpoint or endpoints to listen on; port 0 is any free one.
        connect: Zenoh endpoint or endpoints to connect to.
        zenoh_config: A Zenoh configuration file: certificates, roles, passwords and so on.
        settings: Other settings by their dotted names, as with `--set`: `{"sim.clock_rate": 50.0}`.
        environ: Environment variables; those such as `MJPLUG_SIM__SPEED` are settings. `{}` means none.
        duration: Simulated time after which the server stops by itself [s]; only with `run`.
        run: Whether physics runs in a separate thread. If not, the server starts paused, and the calling thread takes
            steps with `RunningServer.step`.

    Returns:
        The server, which already answers requests. Use it in a `with` statement, or call its `stop`.

    Raises:
        ConfigError: The configuration is invalid; the text contains every problem.
        ModelError: The model cannot be loaded.
        PluginError: A plugin refused to start.
        WireError: The Zenoh session cannot be opened, or the server does not answer a request.
    """
    if not run and duration is not None:
        raise MjplugError("duration needs run=True; with run=False, call step")
    if duration is not None and not 0.0 <= duration <= MAX_SIMULATED_TIME:
        raise MjplugError(f"duration is {duration:g} s; it must be from 0 to {MAX_SIMULATED_TIME} s")
    if not run and paused is False:
        raise MjplugError("paused=False needs run=True; with run=False, the server starts paused")
    scope = LogScope()
    with scope.active():
        draft, classes = draft_of(
            config,
            model=model,
            plugins=plugins,
            paused=paused if run else True,
            speed=speed,
            keyframe=keyframe,
            listen=listen,
            connect=connect,
            zenoh_config=zenoh_config,
            settings=settings,
            environ=environ,
        )
        prepared = prepare(draft, classes)
    return RunningServer(prepared, scope, run, duration)
