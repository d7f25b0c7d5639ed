"""mjplug: a MuJoCo simulation server that communicates over Zenoh with the names and messages of ROS 2."""

__all__ = ["ConfigError", "MjplugError", "RunningServer", "__version__", "open_server"]

TYPE_CHECKING = False
"""True for type checkers only. `typing` is not imported: it takes longer than what comes before Ctrl-C is handled."""

if TYPE_CHECKING:
    from mjplug.config.problem import ConfigError
    from mjplug.errors import MjplugError
    from mjplug.server.open_server import open_server
    from mjplug.server.running import RunningServer

    __version__: str
    """The version of the installed package, such as `0.1.0`; pyproject.toml defines it."""
else:
    _MODULES = {
        "ConfigError": "mjplug.config.problem",
        "MjplugError": "mjplug.errors",
        "RunningServer": "mjplug.server.running",
        "open_server": "mjplug.server.open_server",
    }

    def __getattr__(name):
        # Imported at first use, so that the command line and the client start quickly: the server imports MuJoCo, and
        # importing `importlib.metadata` takes longer than `mjplug --help`.
        if name == "__version__":
            from importlib.metadata import version  # noqa: PLC0415

            return version("mjplug")
        if name in _MODULES:
            from importlib import import_module  # noqa: PLC0415

            return getattr(import_module(_MODULES[name]), name)
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
