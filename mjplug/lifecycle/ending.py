"""Ends the process without the teardown of Python's modules, which is slow on a busy machine."""

import atexit
import os
import sys


class QuickEnd:
    """Ends the process as soon as Python has waited for its threads and called what was registered with `atexit`.

    The teardown that would follow frees every object of every module. It has no use, is slow, and some libraries hang
    in it. Create the object before other modules register functions with `atexit`, because the function that is
    registered first is called last.

    Attributes:
        code: The exit code. While it is None, Python ends as usual, for instance with a traceback.
    """

    def __init__(self) -> None:
        self.code: int | None = None
        atexit.register(self._end)

    def _end(self) -> None:
        if self.code is None:
            return
        for stream in (sys.stdout, sys.stderr):
            if stream is not None:
                try:
                    stream.flush()
                except OSError:
                    # The reader has closed the pipe.
                    continue
        os._exit(self.code)
