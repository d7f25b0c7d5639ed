"""Completion of names of topics, services and actions, answered before typer is imported.

Importing typer and pydantic takes far longer than the query to the server. typer completes everything else, and these
names if options precede them. The shell gets the same answer either way.
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
"""The environment variable with which a shell asks for completions; typer defines its name."""

_NAME = re.compile(r"[A-Za-z0-9_/]+")
"""Other names are left out: a shell evaluates completions, and the names come from the network."""

_TIMEOUT = 1.0
"""Timeout of each query [s]; short, because the user waits at the prompt."""

Kind = Literal["topics", "services", "actions"]

COMMANDS: Final[dict[str, tuple[Kind, frozenset[str]]]] = {
    "topic": ("topics", frozenset({"info", "type", "echo", "pub", "hz", "bw", "delay"})),
    "service": ("services", frozenset({"info", "type", "call"})),
    "action": ("actions", frozenset({"info", "type", "send_goal"})),
}
"""For each group of commands: the kind of names, and the commands whose first argument is such a name."""


def answer() -> bool:
    """Answers the shell if it asks for the names of topics, services or actions.

    Returns:
        Whether it did.
    """
    _join_words()
    shell = os.environ.get(VARIABLE, "").removeprefix("complete_")
    words = typed_words(shell)
    if words is not None and words[:1] in (["teleop"], ["record"]):
        words = ["topic", "pub", *words[1:]]
    if words is None or len(words) != 3 or words[2].startswith("-"):
        return False
    group, command, begin = words
    kind, commands = COMMANDS.get(group, ("topics", frozenset[str]()))
    if command not in commands:
        return False
    _print_names(shell, live_names(kind, begin))
    return True


def answer_with(complete: Callable[[], None]) -> None:
    """Lets typer answer the shell.

    bash splits words at colons, as in `bundled:box`, and replaces only the part after the colon. So the part before it
    is removed from the answers.

    Args:
        complete: Prints the answers, and raises SystemExit.
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


def live_names(kind: Kind, begin: str, endpoint: str | None = None) -> list[str]:
    """Returns the names of topics, services or actions that start with `begin`; none if no server answers.

    Args:
        kind: Topics, services or actions.
        begin: The part of the name that the user has typed.
        endpoint: Where a server listens; the default is that of all commands.
    """
    try:
        from mjplug.cli.light_session import light_session
        from mjplug.wire.discovery.announced import lists

        chosen = endpoint or os.environ.get("MJPLUG_CONNECT")
        offered = set()
        with light_session(chosen or None, timeout_ms=round(1e3 * _TIMEOUT)) as session:
            for _, text in lists(session, _TIMEOUT):
                offered |= {str(entry["name"]) for entry in json.loads(text).get(kind, ())}
    except Exception:
        # A message or a traceback would disturb the prompt.
        return []
    return sorted(name for name in offered if name.startswith(begin) and _NAME.fullmatch(name))


def node_names(begin: str, endpoint: str | None = None) -> list[str]:
    """Returns the names of servers that start with `begin`; none if no server answers.

    Args:
        begin: The part of the name that the user has typed.
        endpoint: Where a server listens; the default is that of all commands.
    """
    try:
        from mjplug.cli.light_session import light_session
        from mjplug.wire.discovery.announced import server_names

        chosen = endpoint or os.environ.get("MJPLUG_CONNECT")
        with light_session(chosen or None, timeout_ms=round(1e3 * _TIMEOUT)) as session:
            found = server_names(session, _TIMEOUT)
    except Exception:
        # A message or a traceback would disturb the prompt.
        return []
    return [name for name in found if name.startswith(begin) and _NAME.fullmatch(name)]


def _join_words() -> None:
    """Joins words that bash has split at colons: `tcp/127.0.0.1`, `:`, `7447` is one argument."""
    if os.environ.get(VARIABLE) != "complete_bash":
        return
    words = re.split(r"[ \n]", os.environ.get("COMP_WORDS", ""))
    number = os.environ.get("COMP_CWORD", "")
    if ":" not in words or not number.isdecimal() or any(quote in word for word in words for quote in "'\"\\"):
        # bash does not split words within quotes.
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
    """Returns the words after `mjplug` up to the one under the cursor; None if no known shell asks for completions.

    Args:
        shell: Which shell asks; default: the shell that the environment variable names.
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
        # For example, a quotation mark is still open.
        return None
    return None


def _print_names(shell: str, names: list[str]) -> None:
    if shell == "zsh":
        quoted = "\n".join(f'"{name}"' for name in names)
        print(f"_arguments '*: :(({quoted}))'" if names else "_files")
    elif shell == "fish" and os.environ.get("_TYPER_COMPLETE_FISH_ACTION") == "is-args":
        sys.exit(0 if names else 1)
    else:
        print("\n".join(names))
