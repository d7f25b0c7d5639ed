"""The status `wire`: refused messages and requests, and waiting requests."""

from mjplug.contracts.diagnostics import Diagnosis, Level
from mjplug.wire.network import Network


class WireDiagnostics:
    """Reports on the period between the last two calls of `diagnose`.

    Args:
        network: The network to report on.
    """

    def __init__(self, network: Network) -> None:
        self._network = network
        self._refused = 0
        self._busy = 0

    def diagnose(self) -> Diagnosis:
        """Returns the status; its level is WARN if messages or requests were refused since the last call."""
        network = self._network
        refused = {name: count for name, count in network.refused().items() if count}
        busy = {name: count for name, count in network.busy().items() if count}
        new_refused, self._refused = sum(refused.values()) - self._refused, sum(refused.values())
        new_busy, self._busy = sum(busy.values()) - self._busy, sum(busy.values())
        values: dict[str, object] = {
            "endpoint": network.session.endpoint,
            "open requests": len(network.open_calls),
            "bytes of open requests": network.open_calls.bytes,
            "answers lost": network.open_calls.replies.lost.count,
            "refused": self._refused,
            "refused as busy": self._busy,
        }
        values |= {f"refused on {name}": count for name, count in refused.items()}
        values |= {f"refused as busy on {name}": count for name, count in busy.items()}
        problems = []
        if new_refused:
            what = "a message or request" if new_refused == 1 else f"{new_refused} messages or requests"
            problems.append(f"{what} could not be read; the log says why")
        if new_busy:
            what = "a request was" if new_busy == 1 else f"{new_busy} requests were"
            problems.append(f"{what} refused as busy")
        if problems:
            return Diagnosis(Level.WARN, "; ".join(problems), values)
        return Diagnosis(Level.OK, f"reachable at {network.session.endpoint}", values)
