"""Types commands at a live server, in this very process, which saves the start of Python for each."""

import contextlib
import io
import sys
from dataclasses import dataclass
from unittest import mock

from cli.process import Served

from mjplug.cli import main

WORLD = """\
<mujoco model="tour">
  <option timestep="0.001" gravity="0 0 0"/>
  <worldbody>
    <body name="box" pos="0 0 1"><freejoint name="box_free"/><geom type="box" size=".1 .1 .1"/></body>
    <camera name="front" pos="0 -3 1" xyaxes="1 0 0 0 0 1"/>
    <body name="arm"><joint name="shoulder" axis="0 1 0" range="-1 1" limited="true"/>
      <geom type="capsule" size=".05" fromto="0 0 0 .5 0 0"/><site name="tip" pos=".5 0 0"/></body>
  </worldbody>
  <actuator><motor name="shoulder_motor" joint="shoulder" ctrlrange="-2 2"/></actuator>
  <sensor><accelerometer name="tip_acceleration" site="tip"/></sensor>
  <keyframe><key name="lifted" qpos="0 0 2 1 0 0 0 .5"/></keyframe>
</mujoco>
"""

OWN_TYPES = """\
from mjplug.plugin import Call, Host, Parameters, Plugin, RequestError
from mjplug_schemas.idl import float64, sequence, string
from mjplug_schemas.message import Message, Service


class Reading(Message, package="tour_msgs"):
    value: float64 = 0.0
    label: string = ""
    history: sequence[float64] = ()


class Calibrate(Service, package="tour_msgs"):
    class Request(Message):
        offset: float64 = 0.0

    class Response(Message):
        message: string = ""


class Thermometer(Plugin[Parameters]):
    def init(self, host: Host, parameters: Parameters) -> None:
        self._offset = 20.0
        publisher = host.create_publisher(Reading, "~/reading")
        host.create_timer(
            0.02, lambda: publisher.publish(Reading(value=self._offset, label="warm", history=(1.0, 2.0)))
        )
        host.create_subscription(Reading, "~/simulated", self._simulate)
        host.create_service(Calibrate, "~/calibrate", self._calibrate)

    def _simulate(self, message: Reading) -> None:
        self._offset = message.value

    def _calibrate(self, request: Calibrate.Request, call: Call) -> Calibrate.Response:
        if request.offset < 0.0:
            raise RequestError("an offset is not negative")
        self._offset = request.offset
        return Calibrate.Response(message=f"offset {request.offset}")
"""
"""A plugin with types that only the server's process has."""

CONFIG = """\
model: tour.xml
sim: {clock_rate: 1000}
remap: {/base_velocity/cmd_vel: /cmd_vel}
plugins:
  external_wrench: {type: external_wrench}
  heartbeat: {type: heartbeat, update_rate: 20}
  base_velocity: {type: base_velocity, body: box}
  free_joints: {type: free_joint_state_publisher, publish_rate: 50}
  thermometer: {type: "own_types:Thermometer"}
"""


@dataclass(frozen=True)
class Done:
    """What a command printed, and how it ended."""

    code: int
    out: str
    err: str

    @property
    def lines(self):
        return self.out.splitlines()


def typed(*words):
    """Runs a command in this process, to its end."""
    out, err = io.StringIO(), io.StringIO()
    with (
        mock.patch.object(sys, "argv", ["mjplug", *words]),
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
    ):
        try:
            main()
            code = 0
        except SystemExit as end:
            code = end.code or 0
    return Done(code, out.getvalue(), err.getvalue())


class Tour:
    """A server, and commands that a user types."""

    def __init__(self, folder):
        (folder / "tour.xml").write_text(WORLD)
        (folder / "tour.yaml").write_text(CONFIG)
        (folder / "own_types.py").write_text(OWN_TYPES)
        self.server = Served("tour.yaml", cwd=folder)
        self.endpoint = self.server.endpoint
        self.environment = {"MJPLUG_CONNECT": self.endpoint, "NO_COLOR": "1", "COLUMNS": "200", "TERM": "dumb"}

    def type(self, *words):
        """Runs a command to its end."""
        with mock.patch.dict("os.environ", self.environment):
            return typed(*words)

    def ask(self, *words):
        """Runs a command that must succeed, and returns what it printed."""
        done = self.type(*words)
        assert done.code == 0, (words, done)
        assert done.err == "", (words, done)
        return done.out

    def fail(self, code, *words):
        """Runs a command that must fail with a code, and returns what it complained about."""
        done = self.type(*words)
        assert done.code == code, (words, done)
        assert "Traceback" not in done.err
        return done.err
