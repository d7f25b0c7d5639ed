"""mjplug: a MuJoCo simulation server that speaks Zenoh, with ROS 2's names and messages."""

from typing import TYPE_CHECKING

__all__ = ["RunningServer", "__version__", "open_server"]

if TYPE_CHECKING:
    from mjplug.server.running import RunningServer, open_server

    __version__: str
    """The version of the installed package, such as `0.1.0`; pyproject.toml defines it."""
else:

    def __getattr__(name):
        # Imported when it is used, so that the command line and the client start quickly: the server imports MuJoCo,
        # and `importlib.metadata` takes longer to import than `mjplug --help` takes in all.
        if name == "__version__":
            from importlib.metadata import version  # noqa: PLC0415

            return version("mjplug")
        if name in __all__:
            from mjplug.server import running  # noqa: PLC0415

            return getattr(running, name)
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
