"""`/diagnostics`: how the server and its plugins are, once a second of wall time."""

from time import perf_counter

from mjplug.core.loop import Loop
from mjplug.diagnosis import Diagnosis, Diagnostics
from mjplug.plugin import DEFAULT, Host
from mjplug.services.simulation_health import SimulationHealth
from mjplug_schemas.diagnostic_msgs import DiagnosticArray, DiagnosticStatus, KeyValue
from mjplug_schemas.std_msgs import Header


def offer(host: Host, loop: Loop, diagnostics: Diagnostics, server: str) -> None:
    """Publishes every status while somebody listens, paused or not, stamped with simulated time.

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
        status = tuple(_status(f"{host.name}: {name}", server, said) for name, said in diagnostics.diagnose().items())
        publisher.publish(DiagnosticArray(header=Header(stamp=host.now()), status=status))

    health = SimulationHealth(loop, perf_counter())
    diagnostics.add("simulation", health.diagnose)
    publisher = host.create_publisher(DiagnosticArray, "/diagnostics", DEFAULT)
    loop.on_second.append(publish)


def _status(name: str, server: str, said: Diagnosis) -> DiagnosticStatus:
    values = tuple(KeyValue(key=key, value=str(value)) for key, value in said.values.items())
    return DiagnosticStatus(level=int(said.level), name=name, message=said.message, hardware_id=server, values=values)
