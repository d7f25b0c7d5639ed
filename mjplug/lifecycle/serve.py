"""`mjplug serve` opens a server and adds signals, a bounded stop, the ready file and the service manager."""

from collections.abc import Callable
from contextlib import ExitStack, closing
from pathlib import Path

from mjplug.config.settings import Sim
from mjplug.errors import MjplugError
from mjplug.lifecycle.ready_file import ReadyFile
from mjplug.lifecycle.signals import stopping_on_signals
from mjplug.lifecycle.systemd import ServiceManager
from mjplug.lifecycle.view_process import ViewProcess
from mjplug.lifecycle.watchdog import StopWatchdog
from mjplug.physics import process
from mjplug.server.opened import OpenedServer
from mjplug.server.prepared import Prepared
from mjplug.server.whereabouts import whereabouts


def serve(
    prepared: Prepared,
    duration: float | None,
    watchdog: StopWatchdog,
    ready_file: Path | None,
    announce: Callable[[str], None],
    view_port: int | None = None,
) -> None:
    """Runs a server until a signal, or until `duration` has been simulated. The process does nothing else.

    Args:
        prepared: The configuration, model and plugins.
        duration: Simulated time after which the server stops [s]; None means without a limit.
        watchdog: Limits the duration of the stop; already started.
        ready_file: Path of the ready file; None means no file.
        announce: Called with the `ready` line when services answer.
        view_port: Port of the page of the simulation view, which a child process serves; None means no page.

    Raises:
        MjplugError: The server cannot start, or a plugin failed or the simulation diverged under a policy that
            stops the server.
    """
    watchdog.describe = lambda: whereabouts({})
    manager = ServiceManager()
    ready = None if ready_file is None else ReadyFile(ready_file)
    opened = OpenedServer(prepared)
    server = opened.server

    def leave(reason: str) -> None:
        if ready is not None:
            ready.remove()
        opened.network.close(reason)

    watchdog.describe = lambda: whereabouts(server.plugins)
    watchdog.on_forced_stop = leave
    watchdog.on_signal = opened.interrupt
    server.on_stopping += [watchdog.begin, manager.stopping]
    summary = f"{opened.endpoint} · {prepared.summary} · {_state(prepared.loaded.settings.sim)}"
    # The signal handlers stay until the server is closed, so that a repeated signal cannot cut off the last answers.
    with stopping_on_signals(server.loop), closing(opened), ExitStack() as view:
        try:
            if view_port is not None and opened.has_roles:
                raise MjplugError(
                    "--view cannot be used with roles, because every browser on this machine would have the rights of "
                    "the server; run `mjplug view --zenoh-config FILE` with the file of an operator or a viewer"
                )
            if opened.wait_until_ready():
                announce(f"ready · {summary}")
                if view_port is not None:
                    config = prepared.loaded.path(("zenoh", "config"))
                    view.enter_context(closing(ViewProcess(opened.endpoint, config, prepared.name, view_port)))
                if ready is not None:
                    ready.write(opened.endpoint, prepared.name)
                manager.ready(summary, server.loop.inbox)
            with process.frozen_garbage():
                opened.run(duration)
        finally:
            if ready is not None:
                ready.remove()


def _state(sim: Sim) -> str:
    if sim.paused:
        return "paused"
    return "speed max" if sim.speed == "max" else f"speed {sim.speed:g}"
