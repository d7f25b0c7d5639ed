"""Whether a server is healthy, in one sentence: for health checks of containers and service managers."""

from time import perf_counter

import typer

from mjplug.cli.connected import client
from mjplug.cli.output import complain, say

TIMEOUT = 3.0
"""How long a server may take to answer [s]; it takes milliseconds."""

_ERROR = 2
"""Level of a status that reports an error, in diagnostic_msgs."""


def check_quickly(endpoint: str | None, server: str, zenoh_config: str | None, timeout: float) -> None:
    """Sends one request that the physics thread answers, and prints what it says.

    Args:
        endpoint: Where the server listens.
        server: Its name, where several are on the network.
        zenoh_config: A Zenoh configuration file.
        timeout: How long to wait for the answer [s].

    Raises:
        NoServerError: No server is there.
        TimedOutError: It does not answer.
        Exit: It reports errors; the exit code is 1.
    """
    from mjplug.client import request
    from mjplug_schemas.diagnostic_msgs import DiagnosticArray
    from mjplug_schemas.std_srvs import Trigger

    with client(endpoint, server, zenoh_config) as connected:
        name = connected.server.name
        service = connected.service(f"{name}/get_diagnostics")
        began = perf_counter()
        response = request.send(connected.session, service, Trigger.Request(), Trigger, timeout)
        took = perf_counter() - began
    said = DiagnosticArray.from_json(response.message)
    errors = [f"{status.name}: {status.message}" for status in said.status if status.level == _ERROR]
    if errors:
        complain(f"unhealthy: {name} reports {'; '.join(errors)}")
        raise typer.Exit(1)
    time = said.header.stamp.sec + said.header.stamp.nanosec / 1e9
    say(f"healthy: {name} answered after {took * 1e3:.1f} ms, at t = {time:.3f} s")
