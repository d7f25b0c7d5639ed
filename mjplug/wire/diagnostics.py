"""The status `wire`: what was refused, and what waits for an answer."""

from mjplug.contracts.diagnostics import Diagnosis, Level
from mjplug.wire.network import Network


class WireDiagnostics:
    """Compares the network with what it was at the last diagnosis.

    Args:
        network: What to look at.
    """

    def __init__(self, network: Network) -> None:
        self._network = network
        self._refused = 0
        self._busy = 0

    def diagnose(self) -> Diagnosis:
        """Says how it is; it warns as long as more is refused."""
        network = self._network
        refused = {name: count for name, count in network.refused().items() if count}
        busy = {name: count for name, count in network.busy().items() if count}
        unreadable, self._refused = sum(refused.values()) - self._refused, sum(refused.values())
        rushed, self._busy = sum(busy.values()) - self._busy, sum(busy.values())
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
        troubles = []
        if unreadable:
            what = "a message or request" if unreadable == 1 else f"{unreadable} messages or requests"
            troubles.append(f"{what} could not be read; the log says why")
        if rushed:
            what = "a request was" if rushed == 1 else f"{rushed} requests were"
            troubles.append(f"{what} refused as busy")
        if troubles:
            return Diagnosis(Level.WARN, "; ".join(troubles), values)
        return Diagnosis(Level.OK, f"reachable at {network.session.endpoint}", values)
