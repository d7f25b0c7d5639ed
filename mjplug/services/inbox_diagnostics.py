"""The status `inbox`: what waits for the physics thread, and which messages newer ones have replaced."""

from mjplug.contracts.diagnostics import Diagnosis
from mjplug.physics.inbox import Inbox


class InboxDiagnostics:
    """Reports on the calls that other threads post to the physics thread.

    Args:
        inbox: What to look at.
    """

    def __init__(self, inbox: Inbox) -> None:
        self._inbox = inbox

    def diagnose(self) -> Diagnosis:
        """Reports how many messages were replaced. That is normal where only the newest command counts: no warning."""
        # A copy, since other threads add topics.
        replaced = dict(sorted(dict(self._inbox.replaced).items()))
        total = sum(replaced.values())
        values: dict[str, object] = {
            "waiting": self._inbox.waiting,
            "overruns": self._inbox.overruns,
            "replaced": total,
        }
        values |= {f"replaced on {name}": count for name, count in replaced.items()}
        return Diagnosis(
            message=f"{total} messages were replaced by newer ones before they were delivered", values=values
        )
