"""mjplug: a MuJoCo simulation server that speaks Zenoh, with ROS 2's names and messages."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    __version__: str
    """The version of the installed package, such as `0.1.0`; pyproject.toml defines it."""
else:

    def __getattr__(name):
        # Not at import: `importlib.metadata` takes longer to import than `mjplug --help` takes in all.
        if name == "__version__":
            from importlib.metadata import version  # noqa: PLC0415

            return version("mjplug")
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
