"""`/diagnostics`: how the server and its plugins are, once a second of wall time; and whenever somebody asks."""

from collections import deque
from time import perf_counter

from mjplug.contracts.diagnostics import Diagnosis, Diagnostics
from mjplug.physics.loop import SECOND, Loop
from mjplug.plugin import DEFAULT, Call, Host
from mjplug.services.inbox_diagnostics import InboxDiagnostics
from mjplug.services.simulation_diagnostics import SimulationDiagnostics
from mjplug_schemas.diagnostic_msgs import DiagnosticArray, DiagnosticStatus, KeyValue
from mjplug_schemas.std_msgs import Header
from mjplug_schemas.std_srvs import Trigger


def offer(host: Host, loop: Loop, diagnostics: Diagnostics, server: str) -> None:
    """Publishes every status while somebody listens, paused or not, stamped with simulated time.

    `~/get_diagnostics` answers with what would be published, as JSON.

    Args:
        host: The server's own host.
        loop: What the status `simulation` is about.
        diagnostics: Whom to ask.
        server: The server's full name, such as `/robot1/mjplug`: the `hardware_id` of every status.
    """

    def publish(now: float) -> None:
        # Looked at even if nobody listens, so that the first report is about one second too.
        health.look(now)
        if not publisher.matched:
            return
        publisher.publish(ask(now))

    def ask(now: float) -> DiagnosticArray:
        status = tuple(_status(f"{host.name}: {name}", server, said) for name, said in diagnostics.diagnose().items())
        asked.append((now, DiagnosticArray(header=Header(stamp=host.now()), status=status)))
        return asked[-1][1]

    def answer(request: Trigger.Request, call: Call) -> Trigger.Response:
        # Some tell what was new since they were asked, so they are not asked more often than for the topic.
        now = perf_counter()
        recent = asked[-1][1] if asked and now - asked[-1][0] < SECOND else ask(now)
        return Trigger.Response(success=True, message=recent.to_json().decode())

    asked: deque[tuple[float, DiagnosticArray]] = deque(maxlen=1)
    health = SimulationDiagnostics(loop, perf_counter())
    diagnostics.add("simulation", health.diagnose)
    diagnostics.add("inbox", InboxDiagnostics(loop.inbox).diagnose)
    publisher = host.create_publisher(DiagnosticArray, "/diagnostics", DEFAULT)
    loop.on_second.append(publish)
    host.create_service(Trigger, "~/get_diagnostics", answer)


def _status(name: str, server: str, said: Diagnosis) -> DiagnosticStatus:
    values = tuple(KeyValue(key=key, value=str(value)) for key, value in said.values.items())
    return DiagnosticStatus(level=int(said.level), name=name, message=said.message, hardware_id=server, values=values)
