"""The status `inbox`: calls that wait for the physics thread, and messages that newer ones replaced."""

from mjplug.contracts.diagnostics import Diagnosis
from mjplug.physics.inbox import Inbox


class InboxDiagnostics:
    """Reports on the calls that other threads post to the physics thread.

    Args:
        inbox: The inbox of the physics loop.
    """

    def __init__(self, inbox: Inbox) -> None:
        self._inbox = inbox

    def diagnose(self) -> Diagnosis:
        """Returns the number of waiting calls and of replaced messages.

        The level is always OK: replaced messages are normal where only the newest command counts.
        """
        # Copied because other threads add topics.
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
