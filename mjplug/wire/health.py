"""The status `wire`: what was refused, and what waits for an answer."""

from mjplug.diagnosis import Diagnosis, Level
from mjplug.wire.network import Network


class WireHealth:
    """Compares the network with what it was at the last diagnosis.

    Args:
        network: What to look at.
    """

    def __init__(self, network: Network) -> None:
        self._network = network
        self._refused = 0

    def diagnose(self) -> Diagnosis:
        """Says how it is; it warns as long as more is refused."""
        network = self._network
        refused = {name: count for name, count in network.refused().items() if count}
        total = sum(refused.values())
        new, self._refused = total - self._refused, total
        values: dict[str, object] = {
            "endpoint": network.session.endpoint,
            "open requests": len(network.open_calls),
            "answers lost": network.open_calls.replies.lost.count,
            "refused": total,
        }
        values |= {f"refused on {name}": count for name, count in refused.items()}
        if new:
            what = "a message or request" if new == 1 else f"{new} messages or requests"
            return Diagnosis(Level.WARN, f"{what} could not be read; the log says why", values)
        return Diagnosis(Level.OK, f"reachable at {network.session.endpoint}", values)
