"""A world in which everything that a saved state contains is in motion, and what it publishes afterwards."""

import hashlib
import sys
from pathlib import Path

from joint_robots import compiled
from wrenches import push, request

from mjplug.services.states import service as states
from mjplug.testing import World
from mjplug_plugins.base_velocity import BaseVelocity
from mjplug_plugins.external_wrench import ExternalWrench
from mjplug_plugins.free_joint_state_publisher import FreeJointStatePublisher
from mjplug_plugins.heartbeat import Heartbeat
from mjplug_plugins.joints import JointCommands, JointStatePublisher
from mjplug_plugins.lidar import Lidar
from mjplug_plugins.odometry import OdometryPublisher
from mjplug_plugins.sensors import Sensors
from mjplug_plugins.transforms import Transforms
from mjplug_schemas.builtin_interfaces import Duration
from mjplug_schemas.geometry_msgs import Twist, Vector3
from mjplug_schemas.mjplug_msgs import GetStateDigest, RestoreState, SaveState
from mjplug_schemas.sensor_msgs import JointState
from mjplug_schemas.trajectory_msgs import JointTrajectory, JointTrajectoryPoint

SCENE = """
<mujoco>
  <compiler angle="radian"/>
  <option timestep="0.002" integrator="implicitfast">{flags}</option>
  <worldbody>
    <geom type="plane" size="9 9 .1"/>
    <body name="cart" pos="0 0 1.2"><joint name="rail" type="slide" axis="1 0 0" damping="1"/>
      <geom type="box" size=".1 .1 .05" mass="1"/>
      <body name="upper"><joint name="shoulder" axis="0 1 0" damping=".1" armature=".01"/>
        <geom type="capsule" size=".03" fromto="0 0 0 0 0 -.4" mass=".5"/>
        <body name="lower" pos="0 0 -.4"><joint name="elbow" axis="0 1 0" damping=".1" armature=".01"/>
          <geom type="capsule" size=".03" fromto="0 0 0 0 0 -.3" mass=".3"/>
          <site name="imu"/><site name="eye" euler="0 1.57 0"/></body></body></body>
    <body name="base" pos="-2 0 .11"><freejoint/><geom type="box" size=".2 .2 .1" mass="{mass}"/></body>
    <body pos=".4 0 .1"><freejoint/><geom type="box" size=".1 .1 .1"/></body>
    <body name="brick" pos=".43 .02 .31"><freejoint/><geom type="box" size=".1 .08 .1"/></body>
    <body name="top" pos=".38 .01 .52"><freejoint/><geom type="box" size=".07 .1 .1"/></body>
    <body name="ball" pos="1.2 0 .6"><freejoint/><geom size=".1"/></body>
    <body name="driven" mocap="true" pos="0 2 1"><geom size=".05" contype="0" conaffinity="0"/></body>
  </worldbody>
  <actuator>
    <velocity name="rail_drive" joint="rail" kv="50" ctrlrange="-2 2"/>
    <position name="shoulder_servo" joint="shoulder" kp="100" kv="5" ctrlrange="-1.5 1.5" delay="0.011" nsample="9"/>
    <motor name="elbow_motor" joint="elbow" gear="4" forcerange="-5 5"/>
  </actuator>
  <sensor>
    <gyro name="arm_gyro" site="imu" noise=".02"/>
    <accelerometer name="arm_accel" site="imu" noise=".1"/>
    <jointpos name="angle" joint="elbow" noise=".01"/>
  </sensor>
</mujoco>
"""


def scene(sleep=False, mass=3):
    """The MJCF text of the scene.

    Args:
        sleep: Whether bodies at rest sleep.
        mass: Mass of the base [kg].
    """
    return SCENE.format(flags='<flag sleep="enable"/>' if sleep else "", mass=mass)


LIMITS = states.Limits()


class StateWorld(World):
    """A world with the services for saved states, and all bundled plugins that need no renderer."""

    def __init__(self, folder=None, model=None, seed=7, limits=LIMITS, plugins=True, **options):
        super().__init__(compiled(scene()) if model is None else model, paused=True, **options)
        host = self.host("mjplug", seed=seed)
        self.close = states.offer(host, self.loop, seed, "1.2.3", limits, folder).close
        if plugins:
            self.wrench = self.add(ExternalWrench, "wrench")
            self.add(Heartbeat, "heartbeat", update_rate=7.0, topic="~/beat")
            pid = {"p": 20.0, "i": 30.0, "d": 0.5, "i_clamp_max": 2.0, "i_clamp_min": -2.0}
            self.joints = self.add(
                JointCommands,
                "joints",
                pid_gains={"position": {"elbow": pid, "rail": {"p": 3.0, "i": 1.0}}},
                command_timeout=0.7,
            )
            self.drive = self.add(BaseVelocity, "drive", body="base")
            self.add(Sensors, "sensors", rate=130.0, noise=True)
            self.add(JointStatePublisher, "state", topic="~/joint_states", rate=90.0)
            self.add(FreeJointStatePublisher, "free", publish_rate=60.0)
            self.add(OdometryPublisher, "odometry", body="base", origin="start", topic="~/odom", publish_tf=True)
            self.add(Transforms, "frames", rate=45.0)
            self.add(
                Lidar,
                "lidar",
                front={
                    "site": "eye",
                    "resolution": [12, 2],
                    "azimuth_range": [-1.0, 1.0],
                    "elevation_range": [-0.5, 0.5],
                    "max_range": 5.0,
                    "update_rate": 35.0,
                    "noise_std": 0.01,
                    "dropout": 0.1,
                },
            )

    def prepare(self, steps=151):
        """Sets everything in motion: PIDs, a trajectory, a wrench in its ramp, a driven base, bodies in contact."""
        self.publish(
            "/joints/joint_trajectory",
            JointTrajectory(
                joint_names=["shoulder", "elbow"],
                points=[
                    JointTrajectoryPoint(positions=[0.5, -0.7], velocities=[0.1, 0.0], time_from_start=_seconds(0.4)),
                    JointTrajectoryPoint(positions=[-0.9, 0.8], velocities=[0.0, 0.0], time_from_start=_seconds(1.5)),
                ],
            ),
        )
        self.publish("/joints/joint_commands", JointState(name=["rail"], position=[0.8]))
        self.publish("/drive/cmd_vel", Twist(linear=Vector3(x=0.6, y=0.1), angular=Vector3(z=0.8)))
        # One that the state does not contain any more, one that is in its ramp, one that lasts.
        self.push(push("ball", (0, 0, 20), duration=0.05))
        self.push(
            push("brick", (3, 1, 2), point=(0.02, 0, 0), duration=0.9, ramp=0.8), push("top", (0, 2, 0), duration=0.6)
        )
        self.step(steps)
        self.publish("/drive/cmd_vel", Twist(linear=Vector3(x=0.4, y=-0.1), angular=Vector3(z=-0.8)))

    def push(self, *pushes):
        return self.call("/wrench/apply_wrench", request(*pushes))

    def request(self, service, type, /, **fields):
        """Calls a service of the server, and waits for files."""
        call = self.call(f"/mjplug/{service}", type.Request(**fields))
        self.finish(call)
        return call

    def finish(self, call):
        while not call.answered:
            self.loop.inbox.wait(10.0)
            self.loop.step(0)

    def save(self, name="s", **fields):
        return self.response(self.request("save_state", SaveState, name=name, **fields))

    def restore(self, name="s", **fields):
        return self.response(self.request("restore_state", RestoreState, name=name, **fields))

    @staticmethod
    def response(call):
        assert call.refusal is None, call.refusal
        assert call.response.success
        return call.response

    def digest(self):
        return self.response(self.request("get_state_digest", GetStateDigest)).digest

    def clear(self):
        for publisher in self.transport.publishers.values():
            publisher.messages.clear()

    def run(self, steps=1000):
        """Takes steps; returns the digest, and the SHA-256 and number of the messages of each topic."""
        self.clear()
        self.step(steps)
        return self.digest(), self.told()

    def told(self):
        return {
            name: (
                len(publisher.messages),
                hashlib.sha256(b"".join(message.to_cdr() for message in publisher.messages)).hexdigest(),
            )
            for name, publisher in self.transport.publishers.items()
            if name not in ("/mjplug/epoch",)
        }


def _seconds(seconds):
    return Duration.from_ns(round(seconds * 1e9))


def main(what, folder, steps):
    """Runs as a process: `save` saves a state, prints what follows, and runs on; `restore` prints what follows it."""
    world = StateWorld(Path(folder))
    if what == "save":
        world.prepare()
        world.save(file=True)
    else:
        world.restore(file=True, strict=True)
    print(repr(world.run(int(steps))), flush=True)
    while what == "save":
        world.step(100)
    world.close()


if __name__ == "__main__":
    main(*sys.argv[1:])
