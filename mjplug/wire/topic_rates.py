"""The status `topics`: what is published, and how often."""

from collections import defaultdict

from mjplug.contracts.diagnostics import Diagnosis
from mjplug.wire.network import Network


class TopicRates:
    """Compares what was published between two looks at the network.

    Args:
        network: What to look at.
        now: Wall time [s].
    """

    def __init__(self, network: Network, now: float) -> None:
        self._network = network
        self._at = now
        self._sent: dict[str, int] = {}
        self._rates: dict[str, float] = {}

    def look(self, now: float) -> None:
        """Ends the span that `diagnose` reports on, and begins the next.

        Args:
            now: Wall time [s].
        """
        sent: dict[str, int] = defaultdict(int)
        for publisher in self._network.publishers:
            sent[publisher.topic.name] += publisher.sent
        seconds = now - self._at
        if seconds > 0:
            self._rates = {name: (count - self._sent.get(name, 0)) / seconds for name, count in sent.items()}
            self._at, self._sent = now, sent

    def diagnose(self) -> Diagnosis:
        """Says how many messages a second each topic had that somebody listens to.

        Those that a worker publishes are not counted here; their plugins tell how they fare. Of latched topics, which
        need no listener, only those that were written to are named.
        """
        heard = {}
        for publisher in self._network.publishers:
            topic = publisher.topic
            rate = self._rates.get(topic.name, 0.0)
            if publisher.matched and not publisher.remote and (rate or topic.qos.durability == "volatile"):
                heard[topic.name] = rate
        values = {f"{name} (Hz)": rate for name, rate in sorted(heard.items())}
        return Diagnosis(message=f"{sum(heard.values()):.6g} messages a second on {len(heard)} topics", values=values)
