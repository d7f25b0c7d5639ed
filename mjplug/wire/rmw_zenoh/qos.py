"""Quality of service as liveliness tokens carry it, in seven parts joined by `:`.

They are reliability, durability, history and depth, deadline, lifespan, liveliness with its lease: enumerators of rmw
as numbers, durations as `seconds,nanoseconds`. What equals rmw_zenoh's default is left empty. Humble knows concrete
values only, no "system default" and no "best available".
"""

from typing import Literal

from mjplug.contracts.transport import QoS

_DEFAULT_DEPTH = 42
_BEST_EFFORT, _TRANSIENT_LOCAL, _KEEP_ALL = "2", "1", "2"
_INFINITE = ","

SERVICE = QoS(depth=10)
"""What rmw uses for services."""

PARAMETER_SERVICE = QoS(depth=1000)
"""What rmw uses for the services of parameters."""


def qos_chunk(qos: QoS, history: Literal["keep_last", "keep_all"] = "keep_last") -> str:
    """Returns the part of a token that says the quality of service, such as `::,10:,:,:,,`."""
    reliability = _BEST_EFFORT if qos.reliability == "best_effort" else ""
    durability = _TRANSIENT_LOCAL if qos.durability == "transient_local" else ""
    keep = _KEEP_ALL if history == "keep_all" else ""
    depth = "" if qos.depth == _DEFAULT_DEPTH else str(qos.depth)
    automatic = f",{_INFINITE}"
    return ":".join((reliability, durability, f"{keep},{depth}", _INFINITE, _INFINITE, automatic))
