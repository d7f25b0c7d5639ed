"""The lives of servers: what was recorded before and after a reset, a restored state or a restart must not mix.

After a restored state, simulated time goes back, and two instants would have the same time.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

from mjplug.wire.origin import Origin


@dataclass(slots=True)
class Lives:
    """Follows the epochs of the servers that publish. Not thread-safe.

    Attributes:
        server_of: Returns the name of the server whose publishers have a host id; empty if there is none.
        current: The present host and epoch of each server, by its name.
    """

    server_of: Callable[[bytes], str]
    current: dict[str, tuple[bytes, int]] = field(default_factory=dict)
    _ended: set[bytes] = field(default_factory=set)

    def check(self, origin: Origin | None) -> tuple[str, bool]:
        """Follows a message.

        Returns:
            Why a new life begins with it, in one sentence; empty if none begins. And whether it belongs to the life
            before the present one.
        """
        if origin is None or origin.epoch is None:
            return "", False
        server = self.server_of(origin.host)
        if not server:
            # Any program can send any epoch, and a new file for each would fill the disk with files.
            return "", False
        before = self.current.get(server)
        if before is None or before == (origin.host, origin.epoch):
            self.current[server] = (origin.host, origin.epoch)
            return "", False
        if origin.host in self._ended:
            return "", True
        if before[0] != origin.host:
            self._ended.add(before[0])
            self.current[server] = (origin.host, origin.epoch)
            return f"{server} was started again", False
        if origin.epoch < before[1]:
            return "", True
        self.current[server] = (origin.host, origin.epoch)
        return f"{server} was reset, or a state was restored (epoch {origin.epoch})", False

    @property
    def text(self) -> str:
        """The servers and their epochs, for the metadata of a file."""
        return ", ".join(f"{key} {epoch}" for key, (_, epoch) in sorted(self.current.items()))
