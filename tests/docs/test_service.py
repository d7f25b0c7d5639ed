"""The systemd unit in the documentation: systemd accepts it, and the command in it is one of the command line."""

import configparser
import shutil
import subprocess
import sys

import pytest
import typer.main
from docs.markdown import blocks_of

from mjplug.cli.app import app

(UNIT,) = (block.text for block in blocks_of("service.md") if block.language == "ini")


def read_unit():
    parser = configparser.ConfigParser(interpolation=None)
    parser.optionxform = str
    parser.read_string(UNIT)
    return parser


def test_the_command_of_the_unit_is_one_of_the_command_line():
    program, *words = read_unit()["Service"]["ExecStart"].split()
    assert program.rpartition("/")[2] == "mjplug"
    command = typer.main.get_command(app).commands[words[0]]
    assert command.make_context(words[0], words[1:]).params["config"] == "robot.yaml"


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="this machine has no systemd-analyze")
def test_systemd_accepts_the_unit(tmp_path):
    unit = tmp_path / "mjplug.service"
    # The program must exist on the machine that verifies the unit.
    unit.write_text(UNIT.replace("/opt/mjplug/bin/mjplug", sys.executable).replace("User=robot\n", ""))
    command = ["systemd-analyze", "verify", "--recursive-errors=no", str(unit)]
    verified = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert (verified.returncode, verified.stderr) == (0, "")
