"""The command line. Heavy imports (MuJoCo, Zenoh) happen inside the commands, so that `--help` is quick."""

import os
import sys

_INTERRUPTED = 130
"""Exit code after Ctrl-C: 128 and the number of the signal, as shells count."""


def main() -> None:
    """Runs the command line, or answers a shell whose TAB key was pressed."""
    try:
        _run()
    except KeyboardInterrupt:
        # Typer catches it while a command runs, but not before and after.
        sys.exit(_INTERRUPTED)


def _run() -> None:
    from mjplug.cli.interrupt import exit_on_interrupt

    with exit_on_interrupt():
        from mjplug.cli.quick_completion import VARIABLE, answer, answer_with

        completing = VARIABLE in os.environ
        if completing and answer():
            return
        from mjplug.cli.app import main as run

        if completing:
            answer_with(run)
            return
    run()
