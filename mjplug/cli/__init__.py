"""The command line. Heavy imports (MuJoCo, Zenoh) happen inside the commands, so that `--help` is quick."""

from mjplug.cli.app import main

__all__ = ["main"]
