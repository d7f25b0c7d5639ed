"""Builds sdist and wheel into dist/, and tries both outside of the repository: `make release`.

It uploads nothing. To publish the files: `uv publish` (see CONTRIBUTING.md).
"""

import contextlib
import hashlib
import json
import os
import shutil
import signal
import subprocess
import sys
import tarfile
import tempfile
import time
import tomllib
import urllib.request
import zipfile
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]
DIST = ROOT / "dist"
VERSION = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]["version"]
TESTS = ("tests/physics", "tests/services")
"""What is run from the sdist against the installed wheel: steps and values, without sockets."""
PAGE = ("index.html", "page.js", "page.css", "licences.txt")
"""Files of the page of `mjplug view`."""
READY_WITHIN = 60.0
"""How long the server may take to start [s]."""


def main() -> None:
    """Builds and tries; the first step that fails ends the program."""
    with tempfile.TemporaryDirectory(prefix="mjplug-release-") as name:
        folder = Path(name)
        sdist, wheel = build()
        check_page(wheel)
        compare(wheel, folder)
        run("uv", "tool", "run", "twine", "check", "--strict", sdist, wheel)
        source = unpack(sdist, folder)
        python = install(wheel, folder)
        serve(python.parent, folder)
        test(python, source)
    changelog = (ROOT / "CHANGELOG.md").read_text("utf-8")
    if f"## [{VERSION}]" not in changelog:
        print(f"note: CHANGELOG.md has no section [{VERSION}] yet")
    if changes := output("git", "status", "--porcelain"):
        print(f"note: these files are not committed:\n{changes}")
    print(f"dist/{sdist.name} and dist/{wheel.name} are ready")


def build() -> tuple[Path, Path]:
    """Builds the sdist, and the wheel from it."""
    say("build the page of `mjplug view`")
    run("make", "--no-print-directory", "page")
    say("build")
    shutil.rmtree(DIST, ignore_errors=True)
    run("uv", "build", "--quiet", "--out-dir", DIST)
    (sdist,), (wheel,) = DIST.glob("*.tar.gz"), DIST.glob("*.whl")
    if VERSION not in sdist.name or VERSION not in wheel.name:
        sys.exit(f"error: the version is {VERSION}, but these were built: {sdist.name}, {wheel.name}")
    return sdist, wheel


def check_page(wheel: Path) -> None:
    """Checks that the wheel has the page that was built, with the licences of what it bundles."""
    built = {f"mjplug/view/page/{path.name}": path for path in (ROOT / "mjplug/view/page").iterdir()}
    if missing := {f"mjplug/view/page/{name}" for name in PAGE} - built.keys():
        sys.exit(f"error: `make page` has not made {sorted(missing)}")
    with zipfile.ZipFile(wheel) as archive:
        names = set(archive.namelist())
        for name, path in built.items():
            if name not in names or archive.read(name) != path.read_bytes():
                sys.exit(f"error: the wheel lacks {name}, or has another one")


def compare(wheel: Path, folder: Path) -> None:
    """Checks that the repository builds the wheel that the sdist builds."""
    say("compare the wheel from the sdist with one from the repository")
    run("uv", "build", "--quiet", "--wheel", "--out-dir", folder / "direct")
    (direct,) = (folder / "direct").glob("*.whl")
    one, other = contents(wheel), contents(direct)
    if one != other:
        different = sorted(name for name in one.keys() | other.keys() if one.get(name) != other.get(name))
        sys.exit(f"error: the sdist builds another wheel than the repository; these files differ: {different}")


def unpack(sdist: Path, folder: Path) -> Path:
    """Unpacks the sdist, and checks that the tests are in it."""
    with tarfile.open(sdist) as archive:
        archive.extractall(folder, filter="data")
    source = folder / sdist.name.removesuffix(".tar.gz")
    missing = {path.relative_to(ROOT) for path in (ROOT / "tests").rglob("*.py")}
    missing -= {path.relative_to(source) for path in (source / "tests").rglob("*.py")}
    if missing:
        sys.exit(f"error: the sdist lacks {sorted(map(str, missing))}")
    return source


def install(wheel: Path, folder: Path) -> Path:
    """Installs the wheel into a new environment; returns its Python."""
    say("install the wheel into a new environment")
    run("uv", "venv", "--quiet", "--python", sys.executable, folder / "venv", cwd=folder)
    python = folder / "venv" / "bin" / "python"
    run("uv", "pip", "install", "--quiet", "--python", python, f"{wheel}[view]", cwd=folder)
    return python


def serve(scripts: Path, folder: Path) -> None:
    """Serves a model with the installed command, uses it from a second process, and stops it."""
    say("serve a model")
    mjplug = scripts / "mjplug"
    if (shown := output(mjplug, "--version", cwd=folder)) != f"mjplug {VERSION}":
        sys.exit(f"error: the version is {VERSION}, but the installed command prints {shown!r}")
    run(mjplug, "plugin", "list", cwd=folder)
    with server(mjplug, folder) as endpoint:
        run(mjplug, "doctor", "--quick", "--connect", endpoint, cwd=folder)
        run(mjplug, "topic", "echo", "/clock", "--once", "--connect", endpoint, cwd=folder)
        run(mjplug, "sim", "pause", "--connect", endpoint, cwd=folder)
        run(mjplug, "sim", "step", "10", "--connect", endpoint, cwd=folder)
        view(mjplug, endpoint, folder)


def view(mjplug: Path, endpoint: str, folder: Path) -> None:
    """Serves the page with the installed command, and reads its files."""
    command = [mjplug, "view", "--connect", endpoint, "--port", "0", "--no-open"]
    with subprocess.Popen(command, cwd=folder, env=environment(), stdout=subprocess.PIPE, text=True) as process:
        try:
            if process.stdout is None or not (line := process.stdout.readline()).startswith("ready · "):
                sys.exit("error: `mjplug view` did not become ready")
            url = line.removeprefix("ready · ").split()[0]
            for name in ("", *PAGE):
                with urllib.request.urlopen(f"{url.rstrip('/')}/{name}", timeout=READY_WITHIN) as response:
                    if not response.read():
                        sys.exit(f"error: `mjplug view` serves an empty {name or 'page'}")
        finally:
            process.terminate()


@contextlib.contextmanager
def server(mjplug: Path, folder: Path) -> Iterator[str]:
    """Runs a server on a free port, and gives its endpoint; SIGTERM must end it with exit code 0."""
    ready = folder / "ready.json"
    serving = ["serve", "bundled:box", "--plugin", "heartbeat", "--listen", "tcp/127.0.0.1:0", "--ready-file", ready]
    process = subprocess.Popen([mjplug, *serving], cwd=folder)
    try:
        until = time.monotonic() + READY_WITHIN
        while not ready.exists():
            if process.poll() is not None or time.monotonic() > until:
                sys.exit(f"error: the server was not ready within {READY_WITHIN:g} s")
            time.sleep(0.1)
        yield json.loads(ready.read_text("utf-8"))["endpoint"]
        process.send_signal(signal.SIGTERM)
        if (code := process.wait(10.0)) != 0:
            sys.exit(f"error: the server ended with exit code {code} after SIGTERM")
    finally:
        process.kill()
        process.wait()


def test(python: Path, source: Path) -> None:
    """Runs tests of the sdist against the installed wheel."""
    say("run tests of the sdist with the wheel")
    tools = ("pytest", "pytest-timeout", "hypothesis")
    run("uv", "pip", "install", "--quiet", "--python", python, *tools, cwd=source)
    # By the script: `python -m pytest` would import the packages that lie beside the tests.
    run(python.with_name("pytest"), "-q", "-m", "not slow", *TESTS, cwd=source)


def contents(wheel: Path) -> dict[str, str]:
    """Returns the hash of every file of a wheel, by name."""
    with zipfile.ZipFile(wheel) as archive:
        return {name: hashlib.sha256(archive.read(name)).hexdigest() for name in archive.namelist()}


def run(*command: str | Path, cwd: Path = ROOT) -> None:
    """Runs a command; ends the program if it fails."""
    if (code := subprocess.run(command, cwd=cwd, env=environment(), check=False).returncode) != 0:
        sys.exit(f"error: exit code {code} of: {' '.join(map(str, command))}")


def output(*command: str | Path, cwd: Path = ROOT) -> str:
    """Returns what a command prints; nothing if the program does not exist."""
    try:
        return subprocess.run(
            command, cwd=cwd, env=environment(), capture_output=True, text=True, check=False
        ).stdout.strip()
    except FileNotFoundError:
        return ""


def environment() -> dict[str, str]:
    """Returns the environment without settings that would reach the server under trial."""
    return {name: value for name, value in os.environ.items() if not name.startswith(("MJPLUG_", "PYTHON"))}


def say(step: str) -> None:
    """Prints what comes next."""
    print(f"=== {step}", flush=True)


if __name__ == "__main__":
    main()
