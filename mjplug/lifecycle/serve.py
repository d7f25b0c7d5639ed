"""What `mjplug serve` does: opens a server, announces it, runs it until a signal, and bounds the stop."""

import logging
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

from mjplug.config.settings import Sim
from mjplug.lifecycle.ready_file import ReadyFile
from mjplug.lifecycle.signals import stopping_on_signals
from mjplug.lifecycle.systemd import ServiceManager
from mjplug.lifecycle.watchdog import StopWatchdog
from mjplug.lifecycle.whereabouts import whereabouts
from mjplug.server.opening import OpenServer, World
from mjplug.server.readiness import wait_until_ready

_log = logging.getLogger(__name__)


def serve(
    world: World,
    duration: float | None,
    watchdog: StopWatchdog,
    ready_file: Path | None,
    announce: Callable[[str], None],
) -> None:
    """Serves until a signal, or until `duration` has been simulated.

    Args:
        world: What is served.
        duration: Simulated time after which it ends [s]; None is never.
        watchdog: Bounds the stop; it watches already.
        ready_file: The file that says that services answer.
        announce: Gets the line that says so.

    Raises:
        MjplugError: It cannot start, or a plugin or the simulation has failed under a policy that stops the server.
    """
    watchdog.describe = lambda: whereabouts({})
    manager = ServiceManager()
    ready = None if ready_file is None else ReadyFile(ready_file)
    opened = OpenServer(world)
    server, network = opened.server, opened.network

    def leave(reason: str) -> None:
        if ready is not None:
            ready.remove()
        network.close(reason)

    watchdog.describe = lambda: whereabouts(server.plugins)
    watchdog.farewell = leave
    watchdog.on_signal = lambda: server.loop.inbox.interrupt(server.loop.stop)
    server.on_stopping += [watchdog.begin, manager.stopping]
    endpoint = network.session.endpoint
    told = f"{endpoint} · {world.summary} · {_state(world.loaded.settings.sim)}"
    # Signals outside, so that a repeated one cannot cut the last answers off.
    with stopping_on_signals(server.loop), closing(opened):
        try:
            if wait_until_ready(server.loop, network):
                announce(f"ready · {told}")
                if ready is not None:
                    ready.write(endpoint, world.name)
                manager.ready(told, server.loop.inbox)
            server.run(duration)
        finally:
            if ready is not None:
                ready.remove()
    simulation = world.simulation
    _log.info("stopped at t = %.3f s, after %d steps", simulation.time_ns / 1e9, simulation.step)


def _state(sim: Sim) -> str:
    if sim.paused:
        return "paused"
    return "speed max" if sim.speed == "max" else f"speed {sim.speed:g}"
