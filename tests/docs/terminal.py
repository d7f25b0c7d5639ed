"""Does what a reader does with a page: saves its files in a folder, types its commands, runs its scripts."""

import os
import re
import shlex
import signal
import subprocess
import sys
import threading
from dataclasses import dataclass, field
from pathlib import Path

import warm_python
from docs.markdown import ROOT, blocks_of

TIMEOUT = 60.0
"""How long a command of the documentation may take [s]."""

ENDPOINT = "tcp/127.0.0.1:7447"
"""The port in the pages; the tests replace it with a free port."""

ANY_PORT = "tcp/127.0.0.1:0"

_LISTENING = re.compile(r"ready · (\S+)")
_SPEAKS = re.compile(r"(tcp|udp|tls|quic|ws)/[\w.-]+:\d+")


@dataclass(frozen=True)
class Command:
    """A line such as `$ MJPLUG_SIM__SPEED=2 mjplug serve robot.yaml   # twice as fast`."""

    environment: dict[str, str]
    words: list[str]

    @classmethod
    def parse(cls, line: str) -> "Command":
        assert line.startswith("$ "), f"not a command: {line!r}"
        words = shlex.split(line[2:], comments=True)
        environment = {}
        while words and re.fullmatch(r"[A-Z_]+=.*", words[0]):
            name, _, value = words.pop(0).partition("=")
            environment[name] = value
        return cls(environment, words)

    @property
    def talks(self) -> bool:
        """Whether it needs a running server."""
        connecting = (
            self.words[1] in ("topic", "service", "action", "node", "param", "sim", "top", "teleop", "record", "play")
            or "--quick" in self.words
        )
        return self.words[0] == "mjplug" and (connecting or self.words[1] == "view")

    @property
    def shows(self) -> bool:
        """Whether it serves the page until it is stopped."""
        return self.words[:2] == ["mjplug", "view"] and not {"--duration", "--help"} & {*self.words}

    @property
    def serves(self) -> bool:
        """Whether it starts a server or a router that runs until it is stopped."""
        return self.words[:2] in (["mjplug", "serve"], ["mjplug", "router"]) and not {
            "--check",
            "--duration",
            "--help",
        } & {*self.words}


@dataclass
class Server:
    """A running server, and what it has printed up to the line with `ready`."""

    process: "subprocess.Popen[str]"
    printed: str
    endpoint: str


@dataclass
class Reader:
    """One reader at one page: a folder with the files that the page shows, and a terminal in it.

    Attributes:
        page: The page.
        folder: The folder.
        servers: The servers that this reader has started, by command line.
    """

    page: str
    folder: Path
    servers: dict[str, Server] = field(default_factory=dict)

    def save_files(self) -> None:
        for block in blocks_of(self.page):
            if block.file:
                path = self.folder / block.file
                assert not path.exists(), f"{block.name}: {block.file} is shown twice"
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_text(block.text, encoding="utf-8")
        (self.folder / "examples").symlink_to(ROOT / "examples")

    def run(self, command: Command, endpoint: str | None = None) -> "subprocess.CompletedProcess[str]":
        """Runs a command of the page that ends by itself; what it prints on both streams comes as one text.

        A command that talks to a server finds it at `endpoint`.
        """
        words = self._local(command)
        return warm_python.run(
            (sys.executable, "-m", words[0]),
            words[1:],
            cwd=self.folder,
            env=_environment(command, endpoint),
            timeout=TIMEOUT,
            one_stream=True,
        )

    def script(self, text: str, name: str, endpoint: str | None = None) -> "subprocess.CompletedProcess[str]":
        """Runs Python, which finds a server at `endpoint`; a warning is an error."""
        path = self.folder / name
        path.write_text(text, encoding="utf-8")
        return warm_python.run(
            (sys.executable, "-W", "error", str(path)),
            (),
            cwd=self.folder,
            env=_environment(endpoint=endpoint),
            timeout=TIMEOUT,
            one_stream=True,
        )

    def tests(self, arguments: list[str]) -> "subprocess.CompletedProcess[str]":
        """Runs pytest in the folder, without the settings of this repository."""
        return warm_python.run(
            (sys.executable, "-m", "pytest"),
            ("-q", "-p", "no:cacheprovider", "-c", os.devnull, f"--rootdir={self.folder}", *arguments),
            cwd=self.folder,
            env=_environment() | {"PYTHONPATH": str(self.folder)},
            timeout=TIMEOUT,
            one_stream=True,
        )

    def server(self, line: str, as_it_is: bool = False) -> Server:
        """Returns the server that a command line starts, started now if it is not yet running.

        Args:
            line: The command line.
            as_it_is: Whether its endpoints are used as they stand; otherwise it gets a free port.
        """
        if line not in self.servers:
            self.servers[line] = self._start(Command.parse(line), as_it_is)
        return self.servers[line]

    def view(self, line: str, endpoint: str) -> str:
        """Starts the view of a server, on a free port and without a browser; returns what it has printed."""
        command = Command.parse(f"{line} --port 0 --no-open")
        self.servers[line] = self._start(command, as_it_is=True, endpoint=endpoint)
        return self.servers[line].printed

    def leave(self) -> None:
        """Stops the servers with Ctrl-C, after which each must end well."""
        for server in self.servers.values():
            server.process.send_signal(signal.SIGINT)
        codes = {line: server.process.wait(TIMEOUT) for line, server in self.servers.items()}
        for server in self.servers.values():
            assert server.process.stdout is not None
            server.process.stdout.close()
        self.servers.clear()
        assert not any(codes.values()), codes

    def _start(self, command: Command, as_it_is: bool, endpoint: str | None = None) -> Server:
        program, *words = command.words if as_it_is else self._local(command)
        process = warm_python.popen(
            (sys.executable, "-m", program),
            words,
            cwd=self.folder,
            env=_environment(command, endpoint),
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
        )
        alarm = threading.Timer(TIMEOUT, process.kill)
        alarm.start()
        printed = ""
        assert process.stdout is not None
        for text in process.stdout:
            printed += text
            if found := _LISTENING.search(text):
                alarm.cancel()
                return Server(process, printed, found[1])
        alarm.cancel()
        process.stdout.close()
        raise AssertionError(f"the server ended ({process.wait()}) without getting ready:\n{printed}")

    def _local(self, command: Command) -> list[str]:
        """Keeps a server off other machines and fixed ports; what it connects to is the first server of this reader."""
        words = list(command.words)
        if words[:2] not in (["mjplug", "serve"], ["mjplug", "router"]) or "--check" in words:
            return words
        first = next((server.endpoint for server in self.servers.values()), None)
        for at, word in enumerate(words):
            if _SPEAKS.fullmatch(word):
                connects = words[at - 1] in ("--connect", "-e")
                assert first or not connects, f"there is no server yet to connect to: {words}"
                words[at] = first if first and connects else ANY_PORT
        return words if {"--listen", "-l"} & {*words} else [*words, "--listen", ANY_PORT]


def commands(console: str) -> list[str]:
    """Returns the command lines of a console block; their output belongs in a separate block."""
    return [line.rstrip() for line in console.replace("\\\n", " ").splitlines() if line.strip()]


def matches(printed: str, expected: str) -> bool:
    """Returns whether an output matches a page.

    `...` matches any text, or any lines if alone on a line. Two spaces match any greater number, because the width of a
    table's columns depends on their values.
    """
    pattern = "".join(
        r"(?:.*\n)*" if line.strip() == "..." else _pattern(line.rstrip()) + "\n" for line in expected.splitlines()
    )
    text = "".join(f"{line.rstrip()}\n" for line in printed.splitlines())
    return re.fullmatch(pattern, text) is not None


def _pattern(line: str) -> str:
    escaped = re.escape(line).replace(r"\.\.\.", ".*")
    return re.sub(r"(?:\\ ){2,}", " {2,}", escaped)


def _environment(command: Command | None = None, endpoint: str | None = None) -> dict[str, str]:
    kept = {name: value for name, value in os.environ.items() if not name.startswith("MJPLUG_")}
    there = {"MJPLUG_CONNECT": endpoint} if endpoint is not None else {}
    return {**kept, "PYTHONUNBUFFERED": "1", "COLUMNS": "100", **there, **(command.environment if command else {})}
