"""A server with its network, services, plugins and worker processes.

The thread that opens it is its physics thread: the main thread of `mjplug serve`; with `mjplug.open_server`, a thread
of its own or the thread of the caller.
"""

import logging
import threading
import uuid
from collections.abc import Callable
from contextlib import ExitStack
from time import monotonic, perf_counter

from mjplug.config.instance_names import instance_names
from mjplug.errors import MjplugError, RequestError
from mjplug.server.local_calls import LocalCall, LocalCalls
from mjplug.server.prepared import Prepared
from mjplug.server.readiness import wait_until_ready
from mjplug.server.rehearsal import rehearse
from mjplug.server.server import Server
from mjplug.wire.diagnostics import WireDiagnostics
from mjplug.wire.encoding import Limits
from mjplug.wire.network import Network, open_network
from mjplug.wire.rmw_zenoh.keys import RosSettings
from mjplug.wire.secured import secured
from mjplug.wire.session import SessionSettings
from mjplug.wire.shared_names import TRANSFORMS
from mjplug.wire.topic_rates import TopicRates
from mjplug.worker.pool import ProcessWorkerPool
from mjplug_schemas.mujoco_ros2_control_msgs import StepSimulation

_log = logging.getLogger(__name__)


class OpenedServer:
    """A server on the network. The thread that opens it is its physics thread.

    Only the physics thread may call its methods, except `interrupt`.

    Attributes:
        prepared: Its configuration, model and plugins.
        server: The loop, the services and the plugins.
        network: Its transport.
        has_roles: Whether the Zenoh configuration file gives clients roles.
        calls: Requests from its own process.
        owner: The parameters of requests for steps from its own process.

    Args:
        prepared: As above. It is closed with the server, and also if the server cannot be opened.

    Raises:
        WireError: The Zenoh session cannot be opened.
        PluginError: A plugin refused to start.
    """

    def __init__(self, prepared: Prepared) -> None:
        self.prepared = prepared
        with ExitStack() as closing:
            closing.callback(prepared.close)
            settings, simulation, model = prepared.loaded.settings, prepared.simulation, prepared.model
            zenoh, ros2 = settings.zenoh, None
            if settings.ros2.enabled:
                ros2 = RosSettings(settings.ros2.domain_id, settings.ros2.distro)
            wanted = SessionSettings(zenoh.mode, zenoh.listen, zenoh.connect, prepared.loaded.path(("zenoh", "config")))
            wanted = secured(
                wanted,
                lambda: rehearse(prepared.loaded, model, prepared.plugins, prepared.name, ros2),
            )
            self.has_roles = wanted.access_control is not None
            limits = Limits(zenoh.max_payload_bytes, zenoh.max_json_bytes)
            self.network: Network = open_network(
                wanted, prepared.name, limits, ros2=ros2, now=lambda: (simulation.time_ns, simulation.epoch)
            )
            self._reason = "the server could not start"
            closing.callback(lambda: self.network.close(self._reason))
            workers = ProcessWorkerPool(wanted, self.network.session.endpoints)
            closing.callback(workers.close)
            self.calls = LocalCalls(self.network)
            folder = prepared.loaded.states_folder
            spawnables = prepared.loaded.spawnable_folders
            self.server = Server(settings, simulation, self.calls, prepared.plugins, workers, model, folder, spawnables)
            closing.callback(self.server.end)
            if prepared.topic in [publisher.topic.name for publisher in self.network.publishers]:
                _log.warning(
                    "this server publishes %s, where its model comes from: late subscribers get two descriptions; give "
                    "the plugin another topic, or leave it out",
                    prepared.topic,
                )
            loop, physics_thread = self.server.loop, threading.get_ident()
            # Steps that a client has requested continue while the simulation is paused.
            self.network.open_calls.replies.may_wait = lambda: (
                loop.paused and not loop.goals and threading.get_ident() == physics_thread
            )
            # The program that runs the server steps it as a client that is always present.
            self.owner = {"owner": f"local-{uuid.uuid4().hex}"}
            self.server.ownership.changed(self.owner["owner"], present=True)
            rates = TopicRates(self.network, perf_counter())
            self.server.loop.on_second.insert(0, rates.refresh)
            self.server.diagnostics.add("wire", WireDiagnostics(self.network).diagnose)
            self.server.diagnostics.add("topics", rates.diagnose)
            has_prefix = any(instance_names(settings, name).frame_prefix for name in settings.plugins)
            self.network.watch_shared_names((TRANSFORMS,) if has_prefix else ())
            self._reason = "the server is stopping"
            self._closing = closing.pop_all()

    @property
    def endpoint(self) -> str:
        """The Zenoh endpoint where clients connect."""
        return self.network.session.endpoint

    def wait_until_ready(self) -> bool:
        """Sends the server a request, and handles requests until the answer comes.

        Returns:
            True after the answer; False if `interrupt` was called first.

        Raises:
            WireError: There was no answer in time.
        """
        return wait_until_ready(self.server.loop, self.network)

    def run(self, duration: float | None = None) -> None:
        """Runs physics at the real-time factor until the server is stopped or `duration` has been simulated [s].

        Raises:
            MjplugError: A plugin failed, or the simulation diverged, under a policy that stops the server.
        """
        self.server.run(duration)
        simulation = self.prepared.simulation
        _log.info("stopped at t = %.3f s, after %d steps", simulation.time_ns / 1e9, simulation.step)

    def step(self, steps: int) -> None:
        """Takes physics steps as a request to `step_simulation` does. The simulation must be paused.

        Args:
            steps: Number of steps; 0 handles only the waiting requests and messages.

        Raises:
            RequestError: Not all steps were taken; the text contains the reason and the number of steps taken.
            MjplugError: A plugin failed, or the simulation diverged, under a policy that stops the server.
        """
        loop = self.server.loop
        if steps == 0:
            loop.step(0)
            self._check_running()
        else:
            call = LocalCall(StepSimulation.Request(steps=steps), self.owner)
            self.calls.send(self.calls.first(StepSimulation), call)
            self.serve_until(lambda: call.answered)
            if call.refusal is not None:
                raise RequestError(call.refusal)

    def serve_for(self, seconds: float | None) -> bool:
        """Handles requests, and takes the steps that clients ask for.

        Args:
            seconds: How long [s of wall time]; None means until the server is stopped.

        Returns:
            Whether the server was stopped.

        Raises:
            MjplugError: A plugin failed, or the simulation diverged, under a policy that stops the server.
        """
        loop = self.server.loop
        until = None if seconds is None else monotonic() + seconds
        # Wakes the loop, which may be waiting for a request.
        alarm = threading.Timer(seconds or 0.0, loop.inbox.post, (_nothing,))
        alarm.daemon = True
        if until is not None:
            alarm.start()
        while not (loop.stopping or (until is not None and monotonic() >= until)):
            loop.turn()
        alarm.cancel()
        if loop.failure is not None:
            raise loop.failure
        return loop.stopping

    def serve_until(self, ended: Callable[[], bool]) -> None:
        """Handles requests, and takes the steps that clients ask for, until `ended` returns true.

        Args:
            ended: Called between steps, and after each call that another thread has posted to the loop.

        Raises:
            MjplugError: The server was stopped, or failed.
        """
        while True:
            self._check_running()
            if ended():
                return
            self.server.loop.turn()

    def _check_running(self) -> None:
        loop = self.server.loop
        if loop.failure is not None:
            raise loop.failure
        if loop.stopping:
            raise MjplugError(f"the server {self.prepared.name} was stopped")

    def interrupt(self) -> None:
        """Ends `run` and the other methods that wait, at the next step. May be called on any thread."""
        loop = self.server.loop
        loop.inbox.interrupt(loop.stop)

    def close(self) -> None:
        """Cancels requests, cleans up plugins, ends worker processes, closes the session. It may be called twice."""
        self._closing.close()


def _nothing() -> None:
    pass
