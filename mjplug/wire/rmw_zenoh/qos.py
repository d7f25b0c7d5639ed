"""Quality of service in liveliness tokens: six parts joined by `:`.

The parts are reliability, durability, history and depth, deadline, lifespan, and liveliness with its lease. Enumerators
of rmw are numbers, durations are `seconds,nanoseconds`. A value that equals rmw_zenoh's default is empty. Humble
supports concrete values only, not "system default" or "best available".
"""

from typing import Literal

from mjplug.contracts.transport import QoS

_DEFAULT_DEPTH = 42
_BEST_EFFORT, _TRANSIENT_LOCAL, _KEEP_ALL = "2", "1", "2"
_INFINITE = ","

SERVICE = QoS(depth=10)
"""The QoS of services in rmw."""

PARAMETER_SERVICE = QoS(depth=1000)
"""The QoS of parameter services in rmw."""


def qos_chunk(qos: QoS, history: Literal["keep_last", "keep_all"] = "keep_last") -> str:
    """Returns the chunk of a token for the quality of service, such as `::,10:,:,:,,`."""
    reliability = _BEST_EFFORT if qos.reliability == "best_effort" else ""
    durability = _TRANSIENT_LOCAL if qos.durability == "transient_local" else ""
    keep = _KEEP_ALL if history == "keep_all" else ""
    depth = "" if qos.depth == _DEFAULT_DEPTH else str(qos.depth)
    automatic = f",{_INFINITE}"
    return ":".join((reliability, durability, f"{keep},{depth}", _INFINITE, _INFINITE, automatic))
