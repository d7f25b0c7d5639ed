"""The tree of commands."""

import errno
import os
import sys
from typing import Annotated

import typer

from mjplug.cli.action import app as action_app
from mjplug.cli.bag import app as bag_app
from mjplug.cli.completion import EPILOG as COMPLETION_EPILOG
from mjplug.cli.completion import completion, prepare
from mjplug.cli.config import app as config_app
from mjplug.cli.convert import convert
from mjplug.cli.doctor.command import doctor
from mjplug.cli.examples import examples
from mjplug.cli.foxglove import foxglove
from mjplug.cli.interface import app as interface_app
from mjplug.cli.keys import app as keys_app
from mjplug.cli.model import app as model_app
from mjplug.cli.node import app as node_app
from mjplug.cli.optional_value import ViewPortCommand
from mjplug.cli.output import complain, complain_of
from mjplug.cli.param import app as param_app
from mjplug.cli.play import play
from mjplug.cli.plugin import app as plugin_app
from mjplug.cli.record import record
from mjplug.cli.router import router
from mjplug.cli.serve import serve
from mjplug.cli.service import app as service_app
from mjplug.cli.sim import app as sim_app
from mjplug.cli.teleop import teleop
from mjplug.cli.top import top
from mjplug.cli.topic import app as topic_app
from mjplug.cli.view import view
from mjplug.config.problem import ConfigError
from mjplug.errors import MjplugError

_CANNOT_WRITE = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)

app = typer.Typer(
    name="mjplug",
    help="A MuJoCo simulation server that speaks Zenoh: ROS 2 topics and services, without ROS.",
    epilog=examples(
        "mjplug serve bundled:arm --plugin heartbeat      (and in another terminal:)",
        "mjplug topic list -t",
        "mjplug topic echo /clock --once",
        "mjplug sim pause",
    )
    + "\n\n\b\nExit codes: 0 ok, 1 failed, 2 usage, 3 configuration, 4 model, 5 network,\n"
    "6 timeout, 7 refused by the server, 40 stop forced, 130 Ctrl-C, 143 SIGTERM.",
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"]},
    # Importing Rich would take longer than all other imports together.
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    # `mjplug completion` does it.
    add_completion=False,
)
app.command(
    cls=ViewPortCommand,
    epilog=examples(
        "mjplug serve config.yaml",
        "mjplug serve bundled:quadruped --keyframe home --plugin heartbeat --plugin external_wrench",
        "mjplug serve ros_params.yaml --model scene.xml --speed max --duration 10",
        "mjplug serve ur.urdf.xacro ur_type:=ur5e name:=ur5e --scene tabletop",
        "mjplug serve scene.xml --listen tcp/0.0.0.0:7447      (lets other machines in)",
        "mjplug serve bundled:arm --view      (shows it in a browser)",
    ),
)(serve)
app.command(
    epilog=examples(
        "mjplug convert robot.urdf -o robot",
        "mjplug convert ur.urdf.xacro ur_type:=ur5e name:=ur5e -o ur5e",
        "mjplug convert robot.urdf --scene tabletop --base fixed",
    )
)(convert)
for group in (
    topic_app, service_app, action_app, node_app, param_app, sim_app, interface_app, model_app, plugin_app,
    config_app, keys_app, bag_app,
):  # fmt: skip
    app.add_typer(group)
app.command(
    epilog=examples(
        "mjplug view",
        "mjplug view --connect tcp/192.168.1.20:7447 --node /robot1/mjplug",
        "mjplug view --listen 0.0.0.0 --read-only      (lets other machines look)",
    )
)(view)
app.command(epilog=examples("mjplug top", "mjplug top --once", "mjplug top --server /robot1/mjplug"))(top)
app.command(
    epilog=examples(
        "mjplug teleop",
        "mjplug teleop /cmd_vel --speed 0.3 --turn 0.8",
        "mjplug teleop /diff_drive_controller/cmd_vel --stamped      (a topic of another program)",
    )
)(teleop)
app.command(
    epilog=examples(
        "mjplug record --all",
        "mjplug record /joint_states /tf /tf_static -o run1",
        "mjplug record -a -x image -d 60      (a new file every minute)",
    )
)(record)
app.command(epilog=examples("mjplug foxglove", "mjplug foxglove --port 9000 --read-only"))(foxglove)
app.command(
    epilog=examples(
        "mjplug play run1",
        "mjplug play run1 --rate 0.5 --loop --clock 100",
        "mjplug play run1 --topics /joint_states --remap /joint_states:=/recorded/joint_states",
    )
)(play)
app.command(
    epilog=examples(
        "mjplug router",
        "mjplug router --listen tcp/0.0.0.0:7447 --zenoh-config router.json5      (lets other machines in)",
        "mjplug serve bundled:box --connect tcp/127.0.0.1:7447",
    )
)(router)
app.command()(doctor)
app.command(epilog=COMPLETION_EPILOG)(completion)


def _print_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        typer.echo(f"mjplug {version('mjplug')}")
        raise typer.Exit


@app.callback()
def _root(
    show_version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Show the version.")
    ] = False,
) -> None:
    pass


def main() -> None:
    """Runs the command line; an error of mjplug is printed without a traceback."""
    prepare()
    try:
        # Otherwise `python -m mjplug` would show `__main__.py` as the name.
        app(prog_name="mjplug")
    except MjplugError as error:
        from mjplug.cli.exit_codes import exit_code

        if isinstance(error, ConfigError):
            complain_of(error)
        else:
            complain(f"error: {error}")
        sys.exit(exit_code(error))
    except OSError as error:
        if error.errno not in _CANNOT_WRITE or error.filename is not None:
            raise
        # Standard output is a file on a full disk. The rest of its buffer could not be written either.
        complain(f"error: cannot write: {error.strerror}")
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(1)
