"""`/rosout`: what the server and its plugins log, for rqt_console and its like."""

import logging
import threading
from collections import deque
from collections.abc import Callable, Iterable, Sequence

from mjplug.log import INSTANCES, PrintableFormatter, ros_string
from mjplug.log_scope import ROOT, current_scope, receive
from mjplug.physics.loop import Loop
from mjplug.plugin import Host, Publisher, QoS
from mjplug_schemas.builtin_interfaces import Time
from mjplug_schemas.rcl_interfaces import Log

ROSOUT = QoS(depth=1000, durability="transient_local")
"""What rcl publishes logs with."""

MOST_WAITING = 1000
"""How many lines may wait to be published; then the oldest are dropped."""

AT_ONCE = 20
"""How many lines are published between two steps; the others wait for the next turn."""

_LEVELS = (Log.FATAL, Log.ERROR, Log.WARN, Log.INFO)
_UINT32 = (1 << 32) - 1

_log = logging.getLogger(__name__)


def offer(host: Host, loop: Loop, server: str, packages: Iterable[str] = ()) -> Callable[[], None]:
    """Publishes every line of this server that is logged from now on, whether somebody listens or not.

    In a `LogScope`, these are the lines of the scope, from loggers of mjplug and of the plugins' packages. Outside of
    any, they are all lines of the process that belong to no other server.

    Args:
        host: The server's own host.
        loop: Lines of other threads get to the physics thread through its inbox.
        server: The server's full name, such as `/robot1/mjplug`.
        packages: The top-level packages of the plugins.

    Returns:
        What ends it, with the lines that still wait; for the physics thread.
    """
    handler = _Handler(host.create_publisher(Log, "/rosout", ROSOUT), loop, server)
    # The root logger is the program's: with a handler there, `logging.basicConfig` would do nothing.
    handler.begin([ROOT] if current_scope() is None else ["mjplug", *packages])
    return handler.end


class _Handler(logging.Handler):
    """Keeps lines until the physics thread publishes them. It never blocks and never logs of itself."""

    def __init__(self, publisher: Publisher[Log], loop: Loop, server: str) -> None:
        super().__init__()
        self._publisher = publisher
        self._loop = loop
        self._server = server.strip("/").replace("/", ".")
        self._waiting: deque[Log] = deque(maxlen=MOST_WAITING)
        self._posted = False
        self._dropped = 0
        self._publishing: int | None = None
        self._formatter = PrintableFormatter()
        self._stop_receiving: Callable[[], None] = _nothing

    def begin(self, loggers: Sequence[str]) -> None:
        """Takes lines from now on."""
        self._stop_receiving = receive(self, loggers)

    def emit(self, record: logging.LogRecord) -> None:
        """Takes a line, on any thread; `logging` lets one thread in at a time."""
        # What publishing itself logs would make it publish for ever.
        if self._publishing == threading.get_ident():
            return
        try:
            line = self._line(record)
        except Exception:
            self.handleError(record)
            return
        self._dropped += len(self._waiting) == MOST_WAITING
        self._waiting.append(line)
        if not self._posted:
            self._posted = True
            self._loop.inbox.post(self._publish)

    def end(self) -> None:
        """Publishes what waits, and takes no more."""
        self._stop_receiving()
        while self._waiting:
            self._publish()

    def _publish(self) -> None:
        self._posted = False
        self._publishing = threading.get_ident()
        try:
            if self._dropped:
                dropped, self._dropped = self._dropped, 0
                text = f"{dropped} lines came faster than they could be published, and are missing here"
                self._publisher.publish(Log(level=Log.WARN, name=self._server, msg=text))
            for _ in range(min(AT_ONCE, len(self._waiting))):
                self._publisher.publish(self._waiting.popleft())
        except Exception:
            self._stop_receiving()
            self._waiting.clear()
            _log.exception("the log cannot be published, so /rosout ends here")
        finally:
            self._publishing = None
        if self._waiting and not self._posted:
            self._posted = True
            self._loop.inbox.post(self._publish)

    def _line(self, record: logging.LogRecord) -> Log:
        return Log(
            # As in ROS, not the simulated time: a log tells when its reader could have looked.
            stamp=Time.from_ns(int(record.created * 1e9)),
            level=next((level for level in _LEVELS if record.levelno >= level), Log.DEBUG),
            name=ros_string(self._name_of(record.name)),
            msg=ros_string(self._formatter.format(record)),
            file=ros_string(record.pathname),
            function=ros_string(record.funcName or ""),
            line=min(max(record.lineno, 0), _UINT32),
        )

    def _name_of(self, logger: str) -> str:
        """Returns what ROS would call a logger: that of an instance is the server's child, as are strangers'."""
        instance = logger.removeprefix(f"{INSTANCES}.")
        if instance == logger and (logger == "mjplug" or logger.startswith("mjplug.")):
            return self._server
        return f"{self._server}.{instance}"


def _nothing() -> None:
    pass
