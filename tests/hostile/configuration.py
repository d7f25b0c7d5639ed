"""Hostile configurations and models: `mjplug serve X --check` always ends with a message and an exit code.

The command runs in forked children with a limit of memory and of processor time, since MuJoCo itself may end the
process on a hostile model. Where it does, the same model goes to a process that has nothing but MuJoCo: if that one
ends too, the crash is MuJoCo's, and is counted apart.
"""

import argparse
import contextlib
import io
import json
import os
import re
import resource
import signal
import struct
import subprocess
import sys
import tempfile
import traceback
from pathlib import Path

from hostile.attack import Tally, add_bounds, random_of
from hostile.models import spoilt_model
from hostile.yaml_files import configuration

ROOT = Path(__file__).parents[2]
CODES = (0, 2, 3, 4)
_REFUSED = re.compile(r"^error: plugin \S+ refused to start: ", re.MULTILINE)
"""Exit code if a plugin refuses its parameters for this model."""

MAX_CPU = 8
"""Processor time that a batch of one input may take [s]; a limit for hangs, not for speed."""

MAX_MEMORY = 6 << 30
"""Address space of a child [bytes]."""

BATCH = 100
_DONE = struct.Struct("=qi")

BARE = """
import sys, mujoco
try:
    mujoco.MjModel.from_xml_path(sys.argv[1])
except (ValueError, mujoco.FatalError) as error:
    print(error)
"""
"""Distinguishes a crash of MuJoCo from a crash of the server."""


def seeds():
    """Returns the texts that inputs are made from: configurations with their folders, and models."""
    configurations = sorted((ROOT / "examples").glob("*/config*.yaml")) + [ROOT / "tests/hostile/world/config.yaml"]
    models = sorted((ROOT / "mjplug/bundled").glob("*.xml")) + sorted((ROOT / "examples").glob("*/*.xml"))
    models += sorted((ROOT / "tests").rglob("*.urdf"))
    return configurations, models


def write_input(seed, index, folder):
    """Writes the files of one input into a folder; returns the name of the one to serve."""
    random = random_of(seed, index)
    configurations, models = seeds()
    if random.random() < 0.5:
        chosen = random.choice(configurations)
        text, name = configuration(chosen.read_text(), random), "config.yaml"
        for beside in chosen.parent.iterdir():
            if beside.suffix in (".xml", ".py"):
                link = folder / beside.name
                link.unlink(missing_ok=True)
                link.symlink_to(beside)
        (folder / name).write_bytes(text)
        return name
    content, suffix = spoilt_model(random, [model.read_bytes() for model in models])
    name = f"model{suffix}"
    (folder / name).write_bytes(content)
    (folder / "included.xml").write_text('<mujoco><include file="included.xml"/></mujoco>')
    return name


def check(name):
    """Runs `mjplug serve NAME --check` in this process; returns the exit code, what it printed, and a traceback."""
    from mjplug.cli.app import main

    out, err = io.StringIO(), io.StringIO()
    sys.argv = ["mjplug", "serve", name, "--check"]
    trace, code = "", 0
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            main()
        except SystemExit as end:
            code = end.code if isinstance(end.code, int) else 0 if end.code is None else 1
        except BaseException:
            code, trace = 1, traceback.format_exc()
    return code, out.getvalue() + err.getvalue(), trace


def judged(code, text, trace):
    """Returns what is wrong with the end of a command, or None."""
    if trace or "Traceback (most recent" in text:
        return f"a traceback: {trace or text}"[-3000:]
    if code not in CODES and not (code == 1 and _REFUSED.search(text)):
        return f"exit code {code}: {text[-1000:]}"
    if not text.strip():
        return f"exit code {code} without a sentence"
    if re.search(r"[\x00-\x08\x0b-\x1f\x7f]", text):
        return f"control characters reach the terminal: {text[-500:]!r}"
    if len(text) > 200_000:
        return f"{len(text)} characters of output"
    return None


def _child(seed, indices, writer):
    """Runs inputs in turn; sends the index of each input and its outcome to the parent process."""
    resource.setrlimit(resource.RLIMIT_AS, (MAX_MEMORY, MAX_MEMORY))
    # A crash is expected; its picture of the memory is of no use.
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    with tempfile.TemporaryDirectory() as folder, os.fdopen(writer, "w") as out:
        os.chdir(folder)
        path = list(sys.path)
        for index in indices:
            # Per input: the limit counts from the start of the process.
            used = resource.getrusage(resource.RUSAGE_SELF)
            limit = int(used.ru_utime + used.ru_stime) + MAX_CPU
            resource.setrlimit(resource.RLIMIT_CPU, (limit, resource.RLIM_INFINITY))
            print(json.dumps({"begins": index}), file=out, flush=True)
            name = write_input(seed, index, Path(folder))
            code, text, trace = check(name)
            sys.path[:] = path
            print(json.dumps({"ends": index, "code": code, "wrong": judged(code, text, trace)}), file=out, flush=True)
    os._exit(0)


def run_batch(tally, seed, indices):
    """Runs some inputs in a child; returns those that are left when it died, without the one that is to blame."""
    reader, writer = os.pipe()
    sys.stdout.flush()
    child = os.fork()
    if child == 0:
        os.close(reader)
        null = os.open(os.devnull, os.O_RDWR)
        # MuJoCo writes to the file descriptors themselves.
        os.dup2(null, 1)
        os.dup2(null, 2)
        try:
            _child(seed, indices, writer)
        finally:
            os._exit(70)
    os.close(writer)
    begun, ended = None, None
    with os.fdopen(reader) as lines:
        for line in lines:
            told = json.loads(line)
            if "begins" in told:
                begun = told["begins"]
                continue
            ended = told["ends"]
            tally.inputs += 1
            tally.count("refused", told["code"] != 0)
            if told["wrong"]:
                tally.find(ended, told["wrong"])
    _, status = os.waitpid(child, 0)
    if begun == ended and os.waitstatus_to_exitcode(status) == 0:
        return []
    if begun is None:
        tally.find(indices[0], f"the child ended with {os.waitstatus_to_exitcode(status)} before its first input")
        return []
    code = os.waitstatus_to_exitcode(status)
    if begun != indices[0]:
        # A model for which the memory does not suffice can leave MuJoCo such that it never ends with the next one. The
        # server compiles one model only, so what counts is how this input ends in a new process.
        tally.count("begun again in a new process")
        print(f"again: seed {seed}, input {begun}: {_ending(code)} after other inputs", flush=True)
        return [index for index in indices if index >= begun]
    tally.inputs += 1
    _judge_crash(tally, seed, begun, code)
    return indices[1:]


def _ending(code):
    return signal.Signals(-code).name if code < 0 else f"exit code {code}"


def _judge_crash(tally, seed, index, code):
    """Counts a crash as MuJoCo's if a process with MuJoCo alone crashes on the same model."""
    with tempfile.TemporaryDirectory() as folder:
        name = write_input(seed, index, Path(folder))
        by = _ending(code)
        if name.startswith("model"):
            bare = subprocess.run(
                ["prlimit", f"--as={MAX_MEMORY}", f"--cpu={MAX_CPU // 2}", sys.executable, "-c", BARE, name],
                cwd=folder,
                capture_output=True,
                text=True,
                check=False,
            )
            if bare.returncode not in (0, 1) or "Traceback" in bare.stderr:
                tally.count("crashes of MuJoCo itself")
                print(
                    f"upstream: seed {seed}, input {index}: bare MuJoCo ends with {bare.returncode} ({by} here)",
                    flush=True,
                )
                return
        tally.find(index, f"the process ended with {by}", (Path(folder) / name).read_bytes())


def processes(tally, seed, first, count):
    """Runs a few inputs as a user does, in processes of their own."""
    from cli.process import run

    for index in range(first, first + count):
        with tempfile.TemporaryDirectory() as folder:
            name = write_input(seed, index, Path(folder))
            ended = run("serve", name, "--check", cwd=Path(folder), within=120.0)
            tally.inputs += 1
            if ended.returncode < 0:
                _judge_crash(tally, seed, index, ended.returncode)
            elif wrong := judged(ended.returncode, ended.stdout + ended.stderr, ""):
                tally.find(index, wrong)


def main(argv=None):
    """Runs the attack; returns the exit code."""
    parser = argparse.ArgumentParser(description="Checks hostile configurations and models.")
    add_bounds(parser, 2_000, 600.0)
    parser.add_argument(
        "--processes", type=int, default=3, help="inputs that run as real processes besides (default 3)"
    )
    parser.add_argument("--write", action="store_true", help="write the first input to the current folder, and end")
    options = parser.parse_args(argv)
    if options.write:
        print(write_input(options.seed, options.first, Path.cwd()))
        return 0
    tally = Tally(
        "configuration",
        options.seed,
        options.seconds,
        counts={"refused": 0, "unanswered": 0},
        module="hostile.configuration",
    )
    # Imported before the children are forked, so that each does not do it again.
    import mjplug.cli.app
    import mjplug.model.file
    import mjplug.plugin.registry
    import mjplug.server.server

    for name in mjplug.plugin.registry.registered():
        mjplug.plugin.registry.find(name)
    index, end = options.first, options.first + options.count
    while index < end and not tally.over:
        batch = list(range(index, min(index + BATCH, end)))
        index = batch[-1] + 1
        while batch and not tally.over:
            batch = run_batch(tally, options.seed, batch)
    processes(tally, options.seed, options.first, options.processes)
    return tally.end()


if __name__ == "__main__":
    sys.exit(main())
