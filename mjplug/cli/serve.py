"""`mjplug serve`: from a configuration file or a model to a running server."""

import json
import logging
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated

import typer

from mjplug.cli.engine import import_mujoco
from mjplug.cli.output import say
from mjplug.errors import ConfigError, MjplugError, UnknownName
from mjplug.lifecycle.ending import QuickEnd
from mjplug.lifecycle.watchdog import StopWatchdog
from mjplug.limits import LONGEST_TIME
from mjplug.log import logging_to_stderr

if TYPE_CHECKING:
    from mjplug.config.draft import Draft
    from mjplug.config.load import Option
    from mjplug.config.settings import Sim
    from mjplug.core.simulation import Simulation

PATIENCE = 2.0
"""How long a model may compile before the user is told that it still does [s]."""

_log = logging.getLogger(__name__)


def serve(
    config: Annotated[
        str,
        typer.Argument(
            metavar="CONFIG|MODEL",
            help="A configuration file, a ROS parameter file (with --model), or a model: .xml .mjb .urdf bundled:NAME package://...",
        ),
    ],
    model: Annotated[str | None, typer.Option(help="The model, in place of the one in the file.")] = None,
    paused: Annotated[bool, typer.Option("--paused", help="Start paused.")] = False,
    keyframe: Annotated[
        str | None, typer.Option(help="Start from this keyframe of the model: its name or index.")
    ] = None,
    speed: Annotated[str | None, typer.Option(metavar="FACTOR|max", help="Real-time factor, or max.")] = None,
    listen: Annotated[
        list[str] | None,
        typer.Option("--listen", "-l", help="Zenoh endpoint to listen on; port 0 takes a free one. Repeatable."),
    ] = None,
    connect: Annotated[
        list[str] | None, typer.Option("--connect", "-e", help="Zenoh endpoint to connect to. Repeatable.")
    ] = None,
    plugin: Annotated[
        list[str] | None,
        typer.Option("--plugin", "-p", metavar="TYPE[:NAME]", help="Add a plugin with default parameters. Repeatable."),
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
        typer.Option("--set", "-s", metavar="KEY=VALUE", help="Set anything, e.g. sim.clock_rate=50. Repeatable."),
    ] = None,
    duration: Annotated[
        float | None, typer.Option(min=0.0, metavar="SECONDS", help="End after so much simulated time.")
    ] = None,
    check: Annotated[
        bool, typer.Option("--check", help="Check configuration, model and plugins, then end; nothing is sent.")
    ] = False,
    ready_file: Annotated[
        Path | None,
        typer.Option(
            metavar="PATH", help="Write this file when services answer (JSON: endpoint); remove it at the end."
        ),
    ] = None,
    verbose: Annotated[int, typer.Option("--verbose", "-v", count=True, help="Say more.")] = 0,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Say only what is wrong.")] = False,
) -> None:
    """Runs a model and puts it on Zenoh.

    Everything in CONFIG can be overridden: --set beats the environment (MJPLUG_SIM__SPEED=2), which beats the file.
    """
    ending = QuickEnd()
    # Imported late, so that `mjplug --help` is quick.
    import_mujoco()
    from mjplug.cli.exit_codes import exit_code
    from mjplug.config.load import Option, read

    if duration is not None and not duration <= LONGEST_TIME:
        raise typer.BadParameter(f"it must be at most {LONGEST_TIME} s, not {duration:g}", param_hint="--duration")
    sets = [*_plugins(plugin or []), *(set_ or [])]
    sets += [Option("--paused", "sim.paused=true")] if paused else []
    # Quoted, so that a name such as 1 or on stays text.
    sets += [Option(f"--keyframe {keyframe}", f"sim.keyframe={json.dumps(keyframe)}")] if keyframe is not None else []
    sets += [Option(f"--speed {speed}", f"sim.speed={speed}")] if speed is not None else []
    sets += [_endpoints("listen", listen)] if listen else []
    sets += [_endpoints("connect", connect)] if connect else []
    sets += [_zenoh_config(zenoh_config)] if zenoh_config is not None else []
    with logging_to_stderr(-1 if quiet else verbose):
        draft = read(config, model=model, sets=sets)
        if check:
            _run(draft, duration, None)
            return
        watchdog = StopWatchdog()
        watchdog.start()
        try:
            _run(draft, duration, watchdog, ready_file)
            ending.code = 0
        except MjplugError as error:
            ending.code = exit_code(error)
            raise
        finally:
            # Python's own end is bounded too: it waits for threads that plugins have started.
            watchdog.begin()


def _run(draft: "Draft", duration: float | None, watchdog: StopWatchdog | None, ready_file: Path | None = None) -> None:
    """Runs a server; without a watchdog, it only checks whether one could run."""
    from mjplug.core import process
    from mjplug.core.model_file import load_model
    from mjplug.core.simulation import Simulation
    from mjplug.plugin.selection import select
    from mjplug.server import Server
    from mjplug.starting_pose import take_starting_pose

    loaded, plugins = select(draft)
    settings = loaded.settings
    for warning in loaded.warnings:
        # A problem has several lines, and has escaped what it quotes.
        _log.warning("%s", warning, extra={"printable": True})
    process.tame_mujoco()
    with _progress(f"compiling {settings.model}"):
        model = load_model(settings.model, *loaded.folders(("model",)))
    try:
        simulation = Simulation(model.model, settings.sim.keyframe)
    except UnknownName as error:
        raise ConfigError([loaded.problem(("sim", "keyframe"), str(error))]) from error
    take_starting_pose(simulation, loaded)
    if not settings.sim.keyframe and (keyframes := simulation.keyframes()):
        _log.info("the model starts in its default pose; other keyframes (--keyframe): %s", ", ".join(keyframes))
    names = ", ".join(p.name for p in plugins) or "none"
    summary = f"model {model.name} ({_size(simulation)}) · plugins: {names}"
    from mjplug.offline import OfflineTransport, OfflineWorkers

    if watchdog is None:
        Server(settings, simulation, OfflineTransport(), plugins, OfflineWorkers(), model.path).cleanup()
        say(f"ok · {summary}")
        return
    from mjplug.lifecycle.readiness import wait_until_ready
    from mjplug.lifecycle.ready_file import ReadyFile
    from mjplug.lifecycle.signals import stopping_on_signals
    from mjplug.lifecycle.systemd import ServiceManager
    from mjplug.lifecycle.whereabouts import whereabouts
    from mjplug.rehearsal import rehearse
    from mjplug.wire.encoding import Limits
    from mjplug.wire.health import WireHealth
    from mjplug.wire.network import open_network
    from mjplug.wire.rmw_zenoh.keys import RosSettings
    from mjplug.wire.secured import secured
    from mjplug.wire.session import SessionSettings
    from mjplug.wire.topic_rates import TopicRates
    from mjplug.worker.workers import ProcessWorkers

    watchdog.describe = lambda: whereabouts({})
    manager = ServiceManager()
    ready = None if ready_file is None else ReadyFile(ready_file)
    zenoh = settings.zenoh
    wanted = SessionSettings(zenoh.mode, zenoh.listen, zenoh.connect, loaded.path(("zenoh", "config")))
    name = f"{settings.namespace}/{settings.node_name}"
    ros2 = None
    if settings.ros2.enabled:
        ros2 = RosSettings(settings.ros2.domain_id, settings.ros2.distro)
    wanted = secured(wanted, lambda: rehearse(loaded, simulation.model, plugins, model.path, name, ros2))
    limits = Limits(zenoh.max_payload_bytes, zenoh.max_json_bytes)
    network = open_network(wanted, name, limits, ros2=ros2)
    workers = ProcessWorkers(wanted, network.session.endpoints)
    try:
        server = Server(settings, simulation, network, plugins, workers, model.path)
    except BaseException:
        workers.close()
        network.close("the server could not start")
        raise
    rates = TopicRates(network, perf_counter())
    server.loop.on_second.insert(0, rates.look)
    server.diagnostics.add("wire", WireHealth(network).diagnose)
    server.diagnostics.add("topics", rates.diagnose)

    def leave(reason: str) -> None:
        if ready is not None:
            ready.remove()
        network.close(reason)

    watchdog.describe = lambda: whereabouts(server.plugins)
    watchdog.farewell = leave
    watchdog.on_signal = lambda: server.loop.inbox.interrupt(server.loop.stop)
    server.on_stopping += [watchdog.begin, manager.stopping]
    endpoint, state = network.session.endpoint, _state(settings.sim)
    with stopping_on_signals(server.loop):
        try:
            if wait_until_ready(server.loop, network):
                typer.echo(f"ready · {endpoint} · {summary} · {state}")
                if ready is not None:
                    ready.write(endpoint, f"{settings.namespace}/{settings.node_name}")
                manager.ready(f"{endpoint} · {summary} · {state}", server.loop.inbox)
            server.run(duration)
        finally:
            # Inside, so that a repeated signal cannot cut the last answers off.
            if ready is not None:
                ready.remove()
            workers.close()
            network.close("the server is stopping")
    _log.info("stopped at t = %.3f s, after %d steps", simulation.time_ns / 1e9, simulation.step)


def _state(sim: "Sim") -> str:
    if sim.paused:
        return "paused"
    return "speed max" if sim.speed == "max" else f"speed {sim.speed:g}"


def _endpoints(name: str, given: list[str]) -> "Option":
    from mjplug.config.load import Option

    return Option(" ".join(f"--{name} {endpoint}" for endpoint in given), f"zenoh.{name}={json.dumps(given)}")


def _zenoh_config(file: str) -> "Option":
    from pathlib import Path

    from mjplug.config.load import Option

    # Absolute, since a name in the configuration counts from the folder of its file.
    return Option(f"--zenoh-config {file}", f"zenoh.config={json.dumps(str(Path(file).resolve()))}")


def _plugins(wanted: list[str]) -> "list[str | Option]":
    """Turns `--plugin TYPE[:NAME]` into `--set plugins.NAME.type=TYPE`.

    Raises:
        BadParameter: Two of them have one name.
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
                f"two plugins are called {name!r}; give one a name: --plugin {kind}:NAME", param_hint="--plugin"
            )
        sets[name] = Option(f"--plugin {text}", f"plugins.{name}.type={json.dumps(kind)}")
    return list(sets.values())


def _size(simulation: "Simulation") -> str:
    model = simulation.model
    bodies = "1 body" if model.nbody == 2 else f"{model.nbody - 1} bodies"
    return f"{bodies}, {model.nv} DOFs, {model.nu} actuators, {float(model.opt.timestep) * 1e3:g} ms steps"


@contextmanager
def _progress(what: str) -> Iterator[None]:
    """Says after a while that something still goes on."""
    timer = threading.Timer(PATIENCE, _log.info, (f"{what} ...",))
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
