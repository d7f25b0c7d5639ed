"""Publishes the log of the server and its plugins on `/rosout`, for tools such as rqt_console."""

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
"""The QoS of `/rosout` in rcl."""

MAX_WAITING_LINES = 1000
"""Maximum number of log lines that wait to be published; when it is reached, the oldest is dropped."""

MAX_LINES_PER_TURN = 20
"""Maximum number of lines published between two steps; the others wait for the next turn of the loop."""

_LEVELS = (Log.FATAL, Log.ERROR, Log.WARN, Log.INFO)
_UINT32 = (1 << 32) - 1

_log = logging.getLogger(__name__)


def offer(host: Host, loop: Loop, server: str, packages: Iterable[str] = ()) -> Callable[[], None]:
    """Publishes every log line of this server from now on, with or without subscribers.

    In a `LogScope`, these are the lines of the scope, from loggers of mjplug and of the plugins' packages. Without a
    scope, these are all lines of the process that belong to no other server.

    Args:
        host: The server's own host.
        loop: The loop whose inbox passes lines of other threads to the physics thread.
        server: The server's full name, such as `/robot1/mjplug`.
        packages: The top-level packages of the plugins.

    Returns:
        A function that publishes the waiting lines and stops publishing. Call it on the physics thread.
    """
    handler = _Handler(host.create_publisher(Log, "/rosout", ROSOUT), loop, server)
    # In a scope not at the root logger: with a handler there, the program's `logging.basicConfig` would do nothing.
    handler.begin([ROOT] if current_scope() is None else ["mjplug", *packages])
    return handler.end


class _Handler(logging.Handler):
    """Keeps lines until the physics thread publishes them. It never blocks."""

    def __init__(self, publisher: Publisher[Log], loop: Loop, server: str) -> None:
        super().__init__()
        self._publisher = publisher
        self._loop = loop
        self._server = server.strip("/").replace("/", ".")
        self._waiting: deque[Log] = deque(maxlen=MAX_WAITING_LINES)
        self._posted = False
        self._dropped = 0
        self._publishing: int | None = None
        self._formatter = PrintableFormatter()
        self._stop_receiving: Callable[[], None] = _nothing

    def begin(self, loggers: Sequence[str]) -> None:
        """Starts receiving the lines of some loggers."""
        self._stop_receiving = receive(self, loggers)

    def emit(self, record: logging.LogRecord) -> None:
        """Queues a line, on any thread; `logging` holds the handler's lock meanwhile."""
        # A line logged by `_publish` itself would be published in turn, without end.
        if self._publishing == threading.get_ident():
            return
        try:
            line = self._line(record)
        except Exception:
            self.handleError(record)
            return
        self._dropped += len(self._waiting) == MAX_WAITING_LINES
        self._waiting.append(line)
        if not self._posted:
            self._posted = True
            self._loop.inbox.post(self._publish)

    def end(self) -> None:
        """Stops receiving lines, and publishes the waiting ones."""
        self._stop_receiving()
        while self._waiting:
            self._publish()

    def _publish(self) -> None:
        self._posted = False
        self._publishing = threading.get_ident()
        try:
            if self._dropped:
                dropped, self._dropped = self._dropped, 0
                text = f"{dropped} log lines were dropped because they came faster than they could be published"
                self._publisher.publish(Log(level=Log.WARN, name=self._server, msg=text))
            for _ in range(min(MAX_LINES_PER_TURN, len(self._waiting))):
                self._publisher.publish(self._waiting.popleft())
        except Exception:
            self._stop_receiving()
            self._waiting.clear()
            _log.exception("publishing to /rosout failed; no further log lines are published")
        finally:
            self._publishing = None
        if self._waiting and not self._posted:
            self._posted = True
            self._loop.inbox.post(self._publish)

    def _line(self, record: logging.LogRecord) -> Log:
        return Log(
            # Wall time, as in ROS.
            stamp=Time.from_ns(int(record.created * 1e9)),
            level=next((level for level in _LEVELS if record.levelno >= level), Log.DEBUG),
            name=ros_string(self._name_of(record.name)),
            msg=ros_string(self._formatter.format(record)),
            file=ros_string(record.pathname),
            function=ros_string(record.funcName or ""),
            line=min(max(record.lineno, 0), _UINT32),
        )

    def _name_of(self, logger: str) -> str:
        """Returns the ROS name of a logger.

        mjplug's own modules log under the server's name. Plugin instances and other libraries log under
        `<server>.<name>`.
        """
        instance = logger.removeprefix(f"{INSTANCES}.")
        if instance == logger and (logger == "mjplug" or logger.startswith("mjplug.")):
            return self._server
        return f"{self._server}.{instance}"


def _nothing() -> None:
    pass
