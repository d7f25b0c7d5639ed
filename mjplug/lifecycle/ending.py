"""The end of the process, without Python's teardown of every module, which takes long on a busy machine."""

import atexit
import os
import sys


class QuickEnd:
    """Ends the process as soon as Python has waited for its threads and called what was registered with `atexit`.

    The teardown that Python would do next frees every object of every module: much work, of which nobody has anything,
    and in which libraries have been seen to hang. Made before other modules register anything with `atexit`, since what
    is registered first is called last.

    Attributes:
        code: The exit code; while it is None, Python ends in its own way, for instance with a traceback.
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
                    # Its reader is gone.
                    continue
        os._exit(self.code)
