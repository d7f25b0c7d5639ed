"""`mjplug completion`: shell completion of commands, flags, and the names on a running server."""

from typing import Annotated, Literal

import typer

from mjplug.cli.examples import examples
from mjplug.cli.output import say
from mjplug.cli.quick_completion import VARIABLE

_PROGRAM = "mjplug"


def completion(
    shell: Annotated[Literal["bash", "zsh", "fish"], typer.Argument(metavar="SHELL", help="bash, zsh or fish.")],
) -> None:
    """Prints a script that completes commands, flags and live names.

    Load it in the start-up file of the shell.
    """
    # `typer.completion` does not re-export this function explicitly, as mypy requires.
    from typer.completion import get_completion_script  # type: ignore[attr-defined]

    say(get_completion_script(prog_name=_PROGRAM, complete_var=VARIABLE, shell=shell))


EPILOG = examples(
    'eval "$(mjplug completion bash)"                                        (in ~/.bashrc)',
    'eval "$(mjplug completion zsh)"                                         (in ~/.zshrc, after compinit)',
    "mjplug completion fish > ~/.config/fish/completions/mjplug.fish",
)


def prepare() -> None:
    """Prepares typer's completion if a shell has asked for it."""
    import os

    if VARIABLE in os.environ:
        from typer.completion import completion_init  # type: ignore[attr-defined]

        completion_init()
