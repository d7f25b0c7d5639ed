"""Assigns log lines to servers when several servers run in one process.

Each thread of a server runs in the server's `LogScope`: the physics thread, the threads that supervise its worker
processes, and Zenoh's threads while they run one of its callbacks (`bound`). All lines logged in a scope belong to its
server. Lines of a logger from `logger_of_server` belong to the server on any thread.

A server without a scope, as in `mjplug serve`, gets all lines of the process that belong to no other server.
"""

import logging
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from functools import wraps
from itertools import count
from typing import Any, ParamSpec, TypeVar

from mjplug.shared_change import SharedChange, Undo

P = ParamSpec("P")
R = TypeVar("R")

ROOT = ""
"""The name of the root logger, for `receive`."""

_MARK = "mjplug_scope"
"""The attribute of a log record for the number of its scope; a number, because some handlers pickle records."""

_numbers = count(1)

_changing = threading.Lock()
"""Held while the list of handlers changes; never while a line is handled."""


class LogScope:
    """The log lines of one server.

    Attributes:
        number: The number of the scope, unique in the process.
    """

    def __init__(self) -> None:
        self.number = next(_numbers)

    @contextmanager
    def active(self) -> Iterator[None]:
        """Assigns all lines that this thread logs to the scope, until the end of the block."""
        token = _current.set(self)
        try:
            yield
        finally:
            _current.reset(token)


_current: ContextVar[LogScope | None] = ContextVar("mjplug_log_scope", default=None)


def current_scope() -> LogScope | None:
    """Returns the scope of the calling thread; None if it runs in no scope."""
    return _current.get()


def bound(function: Callable[P, R]) -> Callable[P, R]:
    """Returns a wrapper that runs a function in the current scope, on any thread."""
    scope = _current.get()
    if scope is None:
        return function

    @wraps(function)
    def call(*args: P.args, **kwargs: P.kwargs) -> R:
        # Zenoh also runs callbacks on the thread that publishes, which may belong to another server.
        token = _current.set(scope)
        try:
            return function(*args, **kwargs)
        finally:
            _current.reset(token)

    return call


def logger_of_server(name: str) -> logging.Logger:
    """Returns a logger whose lines belong to the current scope, on any thread.

    Its level and its handlers are those of `logging.getLogger(name)`, which is returned if there is no current scope.
    """
    scope = _current.get()
    return logging.getLogger(name) if scope is None else _ServerLogger(name, scope)


def receive(handler: logging.Handler, loggers: Sequence[str]) -> Undo:
    """Passes the lines of the current scope to a handler; without a current scope, the lines that belong to no scope.

    Args:
        handler: Called with each line on the thread that logs it.
        loggers: Names of the loggers, which include their child loggers; none may be a child of another one.

    Returns:
        A function that stops this; a second call does nothing.
    """
    scope = _current.get()
    number = None if scope is None else scope.number
    listening = [_Dispatcher.of(name) for name in dict.fromkeys(loggers)]
    for dispatcher in listening:
        dispatcher.add(number, handler)

    def end() -> None:
        while listening:
            listening.pop().remove(handler)

    return end


class _ServerLogger(logging.Logger):
    """A logger that marks its records with a scope. It is not registered in `logging`, so each server has its own."""

    def __init__(self, name: str, scope: LogScope) -> None:
        super().__init__(name)
        self._scope = scope
        self.parent = logging.getLogger(name)

    # The name and its arguments are the base class's.
    def makeRecord(self, *args: Any, **kwargs: Any) -> logging.LogRecord:  # noqa: N802
        """Returns a record of this scope."""
        record = super().makeRecord(*args, **kwargs)
        setattr(record, _MARK, self._scope.number)
        return record

    def isEnabledFor(self, level: int) -> bool:  # noqa: N802
        """Returns whether the level is enabled. Without a cache, which `logging` clears for registered loggers only."""
        return self.manager.disable < level and level >= self.getEffectiveLevel()

    def __reduce__(self) -> tuple[Any, ...]:
        return logging.getLogger, (self.name,)


class _Dispatcher(logging.Handler):
    """The handler of one logger for all servers. It passes each line to the handlers of the line's server."""

    _known: dict[str, "_Dispatcher"] = {}  # noqa: RUF012

    def __init__(self, name: str) -> None:
        super().__init__()
        self._logger = logging.getLogger(name)
        self._handlers: list[tuple[int | None, logging.Handler]] = []
        self._place = SharedChange(self._attach)

    @classmethod
    def of(cls, name: str) -> "_Dispatcher":
        """Returns the dispatcher of a logger."""
        with _changing:
            return cls._known.setdefault(name, cls(name))

    def add(self, scope: int | None, handler: logging.Handler) -> None:
        """Starts passing the lines of a scope to a handler."""
        with _changing:
            self._handlers = [*self._handlers, (scope, handler)]
        self._place.hold()

    def remove(self, handler: logging.Handler) -> None:
        """Stops passing lines to a handler."""
        with _changing:
            self._handlers = [pair for pair in self._handlers if pair[1] is not handler]
        self._place.release()

    def createLock(self) -> None:  # noqa: N802
        """Creates no lock, so that no server waits for the log of another one. Each handler has its own lock."""
        self.lock = None

    def handle(self, record: logging.LogRecord) -> bool:
        """Passes a line on. From Python 3.13 on, the method of the base class needs the lock."""
        self.emit(record)
        return True

    def emit(self, record: logging.LogRecord) -> None:
        """Passes a line to the handlers of its server."""
        scope = getattr(record, _MARK, None)
        if scope is None and (current := _current.get()) is not None:
            scope = current.number
        for number, handler in self._handlers:
            if number == scope:
                handler.handle(record)
        # If a program has no handlers, Python prints warnings on standard error; this handler would prevent that.
        last = logging.lastResort
        if last is not None and record.levelno >= last.level and self._is_alone(record):
            last.handle(record)

    def _attach(self) -> Undo:
        self._logger.addHandler(self)
        return lambda: self._logger.removeHandler(self)

    def _is_alone(self, record: logging.LogRecord) -> bool:
        """Returns whether only dispatchers handle a record, and this one is the first of them."""
        logger: logging.Logger | None = logging.getLogger(record.name)
        handlers: list[logging.Handler] = []
        while logger is not None:
            handlers += logger.handlers
            logger = logger.parent if logger.propagate else None
        return handlers[:1] == [self] and all(isinstance(handler, _Dispatcher) for handler in handlers)
