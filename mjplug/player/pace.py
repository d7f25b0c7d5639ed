"""When messages are due: log times divided by the rate, from a fixed moment, so that errors do not add up."""

MAX_DELAY = 0.2
"""Maximum delay that is made up for [s]; a longer one stays."""

RATES = 0.01, 100.0
"""Smallest and largest rate."""


class Pace:
    """The pace of a playback. Wall times are those of the caller [s], log times are in ns.

    Attributes:
        rate: Log time per wall time.
        paused: Whether no message is due.
        delays: How often a message was late by more than `MAX_DELAY`.

    Args:
        rate: As above.
        paused: As above.
    """

    def __init__(self, rate: float = 1.0, paused: bool = False) -> None:
        self.rate = rate
        self.paused = paused
        self.delays = 0
        self._wall = 0.0
        self._log = 0

    def start(self, log_time: int, now: float) -> None:
        """Makes a log time due now, after a jump."""
        self._wall, self._log = now, log_time

    def position(self, now: float) -> int:
        """Returns the log time that is due now [ns]."""
        return self._log if self.paused else self._log + round((now - self._wall) * self.rate * 1e9)

    def wait(self, log_time: int, now: float) -> float:
        """Returns how long to wait until a message is due [s]; 0 if it is, infinity while paused."""
        if self.paused:
            return float("inf")
        left = (log_time - self.position(now)) / 1e9 / self.rate
        if left < -MAX_DELAY:
            self.delays += 1
            self.start(log_time, now)
        return max(0.0, left)

    def pause(self, paused: bool, now: float) -> None:
        """Pauses or continues."""
        self.start(self.position(now), now)
        self.paused = paused

    def set_rate(self, rate: float, now: float) -> None:
        """Changes the rate from now on; it is limited to `RATES`."""
        self.start(self.position(now), now)
        self.rate = min(max(rate, RATES[0]), RATES[1])
