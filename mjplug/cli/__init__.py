"""The command line. Heavy imports (MuJoCo, Zenoh) happen inside the commands, so that `--help` is quick."""

import os


def main() -> None:
    """Runs the command line, or answers a shell whose TAB key was pressed."""
    from mjplug.cli.quick_completion import VARIABLE, answer

    if VARIABLE in os.environ and answer():
        return
    from mjplug.cli.app import main as run

    run()
