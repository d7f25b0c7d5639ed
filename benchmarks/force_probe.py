"""A plugin that records when a force from outside first acts."""

import threading
from time import perf_counter

from mjplug.plugin import Host, Parameters, Plugin

_moments: list[float] = []
acting = threading.Event()


class ForceProbe(Plugin[Parameters]):
    """Looks at `xfrc_applied` before every step; it runs in the process of the benchmark."""

    def init(self, host: Host, parameters: Parameters) -> None:
        """Takes part in every step."""
        self._host = host
        host.activate()

    def update(self) -> None:
        """Records the first step with a force."""
        if self._host.data.xfrc_applied.any():
            if not acting.is_set():
                _moments.append(perf_counter())
                acting.set()
        else:
            acting.clear()


def newest() -> float:
    """Returns when the newest force began to act, on the clock of `perf_counter` [s]."""
    return _moments[-1]
