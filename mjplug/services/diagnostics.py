"""Publishes `/diagnostics` once a second of wall time, and answers `~/get_diagnostics` with the same statuses."""

from collections import deque
from time import perf_counter

from mjplug.contracts.diagnostics import Diagnosis, Diagnostics
from mjplug.physics.loop import WALL_TIMER_PERIOD, Loop
from mjplug.plugin import DEFAULT, Call, Host
from mjplug.services.inbox_diagnostics import InboxDiagnostics
from mjplug.services.simulation_diagnostics import SimulationDiagnostics
from mjplug_schemas.diagnostic_msgs import DiagnosticArray, DiagnosticStatus, KeyValue
from mjplug_schemas.std_msgs import Header
from mjplug_schemas.std_srvs import Trigger


def offer(host: Host, loop: Loop, diagnostics: Diagnostics, server: str) -> None:
    """Publishes every status while `/diagnostics` has a subscriber, paused or not, stamped with simulated time.

    The service `~/get_diagnostics` returns the message that would be published, as JSON.

    Args:
        host: The server's own host.
        loop: The loop that the status `simulation` reports on.
        diagnostics: All diagnostic tasks.
        server: The server's full name, such as `/robot1/mjplug`; it becomes the `hardware_id` of every status.
    """

    def publish(now: float) -> None:
        # Refreshed even without subscribers, so that the first report covers one second too.
        simulation.refresh(now)
        if not publisher.matched:
            return
        publisher.publish(collect(now))

    def collect(now: float) -> DiagnosticArray:
        status = tuple(
            _status(f"{host.name}: {name}", server, diagnosis) for name, diagnosis in diagnostics.diagnose().items()
        )
        latest.append((now, DiagnosticArray(header=Header(stamp=host.now()), status=status)))
        return latest[-1][1]

    def get_diagnostics(request: Trigger.Request, call: Call) -> Trigger.Response:
        # Some tasks report changes since their last call, so a request does not call them more often than the topic.
        now = perf_counter()
        message = latest[-1][1] if latest and now - latest[-1][0] < WALL_TIMER_PERIOD else collect(now)
        return Trigger.Response(success=True, message=message.to_json().decode())

    latest: deque[tuple[float, DiagnosticArray]] = deque(maxlen=1)
    simulation = SimulationDiagnostics(loop, perf_counter())
    diagnostics.add("simulation", simulation.diagnose)
    diagnostics.add("inbox", InboxDiagnostics(loop.inbox).diagnose)
    publisher = host.create_publisher(DiagnosticArray, "/diagnostics", DEFAULT)
    loop.on_second.append(publish)
    host.create_service(Trigger, "~/get_diagnostics", get_diagnostics)


def _status(name: str, server: str, diagnosis: Diagnosis) -> DiagnosticStatus:
    values = tuple(KeyValue(key=key, value=str(value)) for key, value in diagnosis.values.items())
    return DiagnosticStatus(
        level=int(diagnosis.level), name=name, message=diagnosis.message, hardware_id=server, values=values
    )
