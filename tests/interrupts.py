"""Ctrl-C at every point of a function, one after the other."""

import itertools
import sys
import threading
from collections.abc import Callable
from types import FrameType
from typing import Any

from waits import TIMEOUT


def interrupted_at_each_point(function: Callable[[], Any]):
    """Calls a function again and again, and interrupts each call one bytecode instruction later than the one before.

    Yields the number of the instruction after each call. Ends when a call was not interrupted any more.
    """
    for number in itertools.count():
        with _Interrupt(number) as interrupt:
            function()
        yield number
        if not interrupt.raised:
            return


class _Interrupt:
    """Raises KeyboardInterrupt before an instruction of the block, and ends it at the end of the block."""

    def __init__(self, number: int) -> None:
        self.raised = False
        self._left = number

    def __enter__(self) -> "_Interrupt":
        self._before = sys.gettrace()
        sys.settrace(self._trace)
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> bool:
        sys.settrace(self._before)
        return self.raised and kind is not None and issubclass(kind, KeyboardInterrupt)

    def _trace(self, frame: FrameType, event: str, argument: object) -> Any:
        if frame.f_code is _Interrupt.__exit__.__code__:
            return None
        frame.f_trace_opcodes, frame.f_trace_lines = True, False
        if event == "opcode":
            if self._left == 0 and not self.raised:
                self.raised = True
                raise KeyboardInterrupt
            self._left -= 1
        return self._trace


def ends(function: Callable[..., Any], *arguments: Any) -> bool:
    """Calls a function on another thread, and returns whether the call ends."""
    thread = threading.Thread(target=function, args=arguments, daemon=True)
    thread.start()
    thread.join(TIMEOUT)
    return not thread.is_alive()
