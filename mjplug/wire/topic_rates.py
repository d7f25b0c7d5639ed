"""The status `topics`: the publishing rate of each topic."""

from collections import defaultdict

from mjplug.contracts.diagnostics import Diagnosis
from mjplug.wire.network import Network


class TopicRates:
    """Reports on the period between the last two calls of `refresh`.

    Args:
        network: The network whose publishers are measured.
        now: Wall time [s].
    """

    def __init__(self, network: Network, now: float) -> None:
        self._network = network
        self._at = now
        self._sent: dict[str, int] = {}
        self._rates: dict[str, float] = {}

    def refresh(self, now: float) -> None:
        """Ends the current period, which `diagnose` then reports on, and starts the next one.

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
        """Returns the messages per second of each topic that has a subscriber.

        Topics of worker processes are not included; their plugins report them. Latched topics, which need no
        subscriber, are included only if messages were published.
        """
        rates = {}
        for publisher in self._network.publishers:
            topic = publisher.topic
            rate = self._rates.get(topic.name, 0.0)
            if publisher.matched and not publisher.remote and (rate or topic.qos.durability == "volatile"):
                rates[topic.name] = rate
        values = {f"{name} (Hz)": rate for name, rate in sorted(rates.items())}
        return Diagnosis(message=f"{sum(rates.values()):.6g} messages per second on {len(rates)} topics", values=values)
