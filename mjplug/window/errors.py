"""The exception of the window."""

from mjplug.errors import MjplugError


class WindowError(MjplugError):
    """The window cannot be opened, or cannot go on; the message says what to do."""
