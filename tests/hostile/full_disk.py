"""Runs every command that writes, on a full disk: an error in one sentence, an exit code, and no part of a file.

The disk is a tmpfs of a few pages in a mount namespace of its own, which needs the right to make one.
"""

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from hostile.attack import Tally, add_bounds

PAGE = 4096

ROS_PARAMETERS = """
/**:
  ros__parameters:
    mujoco_plugins:
      heartbeat: {type: mujoco_ros2_control_plugins/HeartbeatPublisherPlugin}
"""

WRITERS = (
    ("plugin new", ["plugin", "new", "gripper", "--into", "{disk}"], "gripper"),
    ("plugin new, deeper", ["plugin", "new", "gripper", "--into", "{disk}/a/b"], "a"),
    ("config init", ["config", "init", "bundled:arm", "-o", "{disk}/file"], "file"),
    ("config schema", ["config", "schema", "-o", "{disk}/file"], "file"),
    ("config convert", ["config", "convert", "ros.yaml", "--model", "bundled:box", "-o", "{disk}/file"], "file"),
)
"""Commands that make files, and what they make."""

PRINTERS = (
    ["completion", "bash"],
    ["config", "schema"],
    ["config", "show", "bundled:box"],
    ["plugin", "list"],
    ["model", "info", "bundled:arm"],
    ["interface", "list"],
    ["--help"],
    ["serve", "bundled:box", "--check"],
)
"""Commands whose standard output may be a file on a full disk."""


def permitted():
    """Returns why a mount namespace cannot be made, or None."""
    if shutil.which("unshare") is None or shutil.which("mount") is None:
        return "unshare or mount is not installed"
    with tempfile.TemporaryDirectory() as folder:
        command = ["unshare", "-m", "mount", "-t", "tmpfs", "-o", "size=4k", "tmpfs", folder]
        tried = subprocess.run(command, capture_output=True, text=True, check=False)
    return None if tried.returncode == 0 else f"no mount namespace: {tried.stderr.strip()}"


def _mount(disk, pages, inodes):
    # At most a few pages, and a limit of inodes: a file may also be one too many.
    options = f"size={max(pages, 1) * PAGE},nr_inodes={inodes}"
    subprocess.run(["mount", "-t", "tmpfs", "-o", options, "tmpfs", disk], check=True)
    if pages == 0:
        (disk / "ballast").write_bytes(bytes(PAGE))


def _run(*arguments, cwd, **options):
    from cli.process import environment

    command = [sys.executable, "-m", "mjplug", *arguments]
    return subprocess.run(command, cwd=cwd, env=environment(), text=True, timeout=120, check=False, **options)


def write_on_full_disks(tally, first, count, work):
    """Runs the commands that make files, each on a disk with another size."""
    (work / "ros.yaml").write_text(ROS_PARAMETERS)
    for index in range(first, first + count):
        name, arguments, made = WRITERS[index % len(WRITERS)]
        round_ = index // len(WRITERS)
        # The first round has no free page; then few inodes, then few pages.
        pages, inodes = ((0, 100), (50, 3), (1, 100), (50, 5), (2, 100), (3, 100), (50, 4), (4, 100))[round_ % 8]
        disk = Path(tempfile.mkdtemp(dir=work))
        _mount(disk, pages, inodes)
        ended = _run(*(part.format(disk=disk) for part in arguments), cwd=work, capture_output=True)
        what = f"{name} with {pages} pages and {inodes} inodes"
        text = ended.stdout + ended.stderr
        tally.inputs += 1
        tally.count("refused", ended.returncode != 0)
        if "Traceback" in text:
            tally.find(index, f"{what}: {text[-1500:]}")
        elif ended.returncode not in (0, 1) or (ended.returncode and not ended.stderr.startswith("error: ")):
            tally.find(index, f"{what}: exit code {ended.returncode}: {text[-500:]}")
        if ended.returncode and (disk / made).exists():
            tally.find(index, f"{what}: {sorted(str(p.relative_to(disk)) for p in disk.rglob('*'))} is left")
        subprocess.run(["umount", disk], check=True)
        if tally.over:
            return


def print_to_full_disks(tally, work):
    """Runs commands whose standard output is a file on a full disk."""
    disk = Path(tempfile.mkdtemp(dir=work))
    _mount(disk, 0, 100)
    for index, arguments in enumerate(PRINTERS):
        with (disk / "out").open("w") as out:
            ended = _run(*arguments, cwd=work, stdout=out, stderr=subprocess.PIPE)
        tally.inputs += 1
        tally.count("refused", ended.returncode != 0)
        if "Traceback" in ended.stderr or ended.returncode != 1 or "No space left" not in ended.stderr:
            tally.find(f"print {index}", f"{' '.join(arguments)}: exit code {ended.returncode}: {ended.stderr[-1500:]}")
    subprocess.run(["umount", disk], check=True)


def serve_with_a_full_log(tally, work):
    """Serves with standard error on a full disk: the server answers, although nothing can be logged."""
    from cli.client import Client
    from cli.process import FREE_PORT, STARTING, Lines, environment

    disk = Path(tempfile.mkdtemp(dir=work))
    _mount(disk, 0, 100)
    with (disk / "log").open("w") as log:
        command = [sys.executable, "-m", "mjplug", "serve", "bundled:box", "-vv", *FREE_PORT]
        server = subprocess.Popen(command, cwd=work, env=environment(), text=True, stdout=subprocess.PIPE, stderr=log)
    try:
        ready = Lines(server.stdout).wait_for(r"ready.*?(tcp/\S+:\d+)", STARTING)
        tally.inputs += 1
        if ready is None:
            tally.find("log", f"with a full log, the server ends with {server.wait(30)}")
            return
        with Client(ready[1]) as client:
            for payload in (b"\xff", b"{", b"{}"):
                client.send("mjplug/set_pause", payload).answer()
            client.do("mjplug/reset_world")
        server.terminate()
        if server.wait(30) != 0:
            tally.find("log", f"with a full log, the server ends with {server.returncode}")
    finally:
        server.kill()
        server.wait()
        time.sleep(0.1)
        subprocess.run(["umount", disk], check=True)


def main(argv=None):
    """Runs the attack; returns the exit code."""
    parser = argparse.ArgumentParser(description="Runs the commands that write on a full disk.")
    add_bounds(parser, 40, 600.0)
    parser.add_argument("--inside", help=argparse.SUPPRESS)
    options = parser.parse_args(argv)
    if not options.inside:
        if reason := permitted():
            print(f"full disk: skipped: {reason}", flush=True)
            return 0
        with tempfile.TemporaryDirectory() as work:
            given = [f"--{name}={getattr(options, name)}" for name in ("count", "seed", "first", "seconds")]
            command = ["unshare", "-m", sys.executable, "-m", "hostile.full_disk", *given, f"--inside={work}"]
            path = os.pathsep.join([str(Path(__file__).parents[1]), os.environ.get("PYTHONPATH", "")])
            return subprocess.run(command, env={**os.environ, "PYTHONPATH": path}, check=False).returncode
    work = Path(options.inside)
    tally = Tally("full disk", options.seed, options.seconds, counts={"refused": 0, "unanswered": 0})
    write_on_full_disks(tally, options.first, options.count, work)
    if not tally.over:
        print_to_full_disks(tally, work)
        serve_with_a_full_log(tally, work)
    return tally.end()


if __name__ == "__main__":
    sys.exit(main())
