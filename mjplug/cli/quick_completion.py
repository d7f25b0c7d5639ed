"""TAB after the name of a command that takes a topic or service, answered before typer is imported.

Importing typer and pydantic takes far longer than asking the server. Everything else that TAB completes, and these
names with options before them, is left to typer; the shells are told the same either way.
"""

import io
import json
import os
import re
import shlex
import sys
from collections.abc import Callable
from contextlib import redirect_stdout
from typing import Final, Literal

VARIABLE = "_MJPLUG_COMPLETE"
"""The environment variable by which the shell asks; typer's name for it."""

_NAME = re.compile(r"[A-Za-z0-9_/]+")
"""Other names are left out: a shell evaluates what it completes with, and the names come from the network."""

_TIMEOUT = 1.0
"""How long to wait for a server [s]: the user waits at the prompt."""

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
    _join_words()
    shell = os.environ.get(VARIABLE, "").removeprefix("complete_")
    words = typed_words(shell)
    if words is None or len(words) != 3 or words[2].startswith("-"):
        return False
    group, command, begin = words
    kind, commands = COMMANDS.get(group, ("topics", frozenset[str]()))
    if command not in commands:
        return False
    _tell(shell, live_names(kind, begin))
    return True


def answer_with(complete: Callable[[], None]) -> None:
    """Lets typer answer the shell.

    bash takes a colon for the end of a word, as in `bundled:box`, and replaces what follows the colon only. So what
    comes before is left out of the answers.

    Args:
        complete: Prints the answers, and ends with SystemExit.
    """
    if not os.environ.get(VARIABLE, "").startswith("complete_bash"):
        complete()
        return
    words = typed_words("bash")
    done = words[-1].rpartition(":")[0] if words else ""
    answers = io.StringIO()
    try:
        with redirect_stdout(answers):
            complete()
    finally:
        for line in answers.getvalue().splitlines():
            print(line.removeprefix(f"{done}:") if done else line)


def live_names(kind: Literal["topics", "services"], begin: str, endpoint: str | None = None) -> list[str]:
    """Returns the names of topics or services on the network that begin so; none at all if no server answers.

    Args:
        kind: Which.
        begin: What has been typed of the name.
        endpoint: Where a server listens; by default as for every command.
    """
    try:
        from mjplug.cli.light_session import light_session
        from mjplug.wire.discovery.announced import lists

        chosen = endpoint or os.environ.get("MJPLUG_CONNECT")
        offered = set()
        with light_session(chosen or None, timeout_ms=round(1e3 * _TIMEOUT)) as session:
            for _, text in lists(session, _TIMEOUT):
                offered |= {str(entry["name"]) for entry in json.loads(text)[kind]}
    except Exception:
        # Nothing may come between a user and the prompt.
        return []
    return sorted(name for name in offered if name.startswith(begin) and _NAME.fullmatch(name))


def node_names(begin: str, endpoint: str | None = None) -> list[str]:
    """Returns the names of servers on the network that begin so; none at all if no server answers.

    Args:
        begin: What has been typed of the name.
        endpoint: Where a server listens; by default as for every command.
    """
    try:
        from mjplug.cli.light_session import light_session
        from mjplug.wire.discovery.announced import server_names

        chosen = endpoint or os.environ.get("MJPLUG_CONNECT")
        with light_session(chosen or None, timeout_ms=round(1e3 * _TIMEOUT)) as session:
            found = server_names(session, _TIMEOUT)
    except Exception:
        # Nothing may come between a user and the prompt.
        return []
    return [name for name in found if name.startswith(begin) and _NAME.fullmatch(name)]


def _join_words() -> None:
    """Joins what bash has taken apart at colons: `tcp/127.0.0.1`, `:`, `7447` is one word of the command line."""
    if os.environ.get(VARIABLE) != "complete_bash":
        return
    words = re.split(r"[ \n]", os.environ.get("COMP_WORDS", ""))
    number = os.environ.get("COMP_CWORD", "")
    if ":" not in words or not number.isdecimal() or any(quote in word for word in words for quote in "'\"\\"):
        # Within quotes nothing is taken apart.
        return
    joined: list[str] = []
    cursor = int(number)
    for index, word in enumerate(words):
        if joined and index > 1 and (word == ":" or words[index - 1] == ":"):
            joined[-1] += word
            cursor -= index <= int(number)
        else:
            joined.append(word)
    os.environ["COMP_WORDS"], os.environ["COMP_CWORD"] = "\n".join(joined), str(cursor)


def typed_words(shell: str = "") -> list[str] | None:
    """Returns the words after `mjplug` up to the one under the cursor; None if this is no question of a known shell.

    Args:
        shell: Which shell asks; by default the one that the environment names.
    """
    shell = shell or os.environ.get(VARIABLE, "").removeprefix("complete_")
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
