"""TAB after the name of a command that takes a topic or service, answered before typer is imported.

Importing typer and pydantic takes far longer than asking the server. Everything else that TAB completes, and these
names with options before them, is left to typer; the shells are told the same either way.
"""

import os
import shlex
import sys
from typing import Final, Literal

from mjplug.cli.live_names import live_names

VARIABLE = "_MJPLUG_COMPLETE"
"""The environment variable by which the shell asks; typer's name for it."""

COMMANDS: Final[dict[str, tuple[Literal["topics", "services"], frozenset[str]]]] = {
    "topic": ("topics", frozenset({"info", "type", "echo", "pub", "hz", "bw", "delay"})),
    "service": ("services", frozenset({"info", "type", "call"})),
}
"""The groups of commands, what their names are, and the commands whose first word is such a name."""


def answer() -> bool:
    """Answers the shell if it asks for the name of a topic or service.

    Returns:
        Whether it did.
    """
    shell = os.environ.get(VARIABLE, "").removeprefix("complete_")
    words = _typed(shell)
    if words is None or len(words) != 3 or words[2].startswith("-"):
        return False
    group, command, begin = words
    kind, commands = COMMANDS.get(group, ("topics", frozenset[str]()))
    if command not in commands:
        return False
    _tell(shell, live_names(kind, begin))
    return True


def _typed(shell: str) -> list[str] | None:
    """Returns the words after `mjplug` up to the one under the cursor; None if this is no question of a known shell."""
    try:
        if shell == "bash":
            count = int(os.environ["COMP_CWORD"])
            words = shlex.split(os.environ["COMP_WORDS"])[1 : count + 1]
            return [*words, *[""] * (count - len(words))]
        if shell in ("zsh", "fish"):
            line = os.environ["_TYPER_COMPLETE_ARGS"]
            return [*shlex.split(line)[1:], *([""] if line.endswith(" ") else [])]
    except (KeyError, ValueError):
        # A quotation mark that is still open, for one.
        return None
    return None


def _tell(shell: str, names: list[str]) -> None:
    if shell == "zsh":
        quoted = "\n".join(f'"{name}"' for name in names)
        print(f"_arguments '*: :(({quoted}))'" if names else "_files")
    elif shell == "fish" and os.environ.get("_TYPER_COMPLETE_FISH_ACTION") == "is-args":
        sys.exit(0 if names else 1)
    else:
        print("\n".join(names))
