"""A mobile base with a lidar, a camera and an arm, in a room with walls at known places."""

import numpy as np
import zenoh
from waits import TIMEOUT, until

from mjplug.client import connect

XML = """\
<mujoco model="room">
  <option timestep="0.002"/>
  <visual><global offwidth="320" offheight="240"/></visual>
  <asset>
    <texture name="grid" type="2d" builtin="checker" rgb1=".55 .58 .62" rgb2=".62 .65 .7" width="256" height="256"/>
    <material name="grid" texture="grid" texrepeat="6 6"/>
  </asset>
  <worldbody>
    <light pos="0 0 4" dir="0 0 -1"/>
    <geom name="floor" type="plane" size="3 3 .1" material="grid"/>
    <geom name="east" type="box" size=".05 3 .5" pos="3.05 0 .5" rgba=".8 .5 .4 1"/>
    <geom name="west" type="box" size=".05 3 .5" pos="-3.05 0 .5" rgba=".8 .5 .4 1"/>
    <geom name="north" type="box" size="3 .05 .5" pos="0 2.05 .5" rgba=".5 .6 .8 1"/>
    <geom name="south" type="box" size="3 .05 .5" pos="0 -2.05 .5" rgba=".5 .6 .8 1"/>
    <body name="base_link" pos="-1 0 .2">
      <freejoint name="base"/>
      <geom type="box" size=".25 .2 .1" mass="20" rgba=".2 .25 .3 1" friction=".1"/>
      <site name="lidar" pos="0 0 .2" euler="0 0 30"/>
      <site name="dome" pos="0 0 .3"/>
      <camera name="front" pos=".26 0 .15" xyaxes="0 -1 0 0 0 1" fovy="60"/>
      <body name="upper" pos=".1 0 .1">
        <joint name="shoulder" axis="0 1 0" range="-90 60" damping="2"/>
        <geom type="capsule" size=".03" fromto="0 0 0 0 0 .35" mass=".5" rgba=".9 .6 .1 1" contype="0" conaffinity="0"/>
        <body name="slider" pos="0 0 .35">
          <joint name="reach" type="slide" axis="0 0 1" range="0 .2" damping="5"/>
          <geom type="box" size=".03 .03 .05" mass=".1" rgba=".9 .2 .1 1" contype="0" conaffinity="0"/>
        </body>
      </body>
    </body>
    <body name="box" pos="1 1 .15">
      <freejoint name="box"/>
      <geom type="box" size=".15 .15 .15" mass="5" rgba=".2 .7 .3 1"/>
    </body>
  </worldbody>
  <actuator>
    <position name="shoulder_servo" joint="shoulder" kp="60"/>
    <position name="reach_servo" joint="reach" kp="200"/>
  </actuator>
</mujoco>
"""

CONFIG = """\
model: room.xml
plugins:
  drive: {type: base_velocity, body: base_link, cmd_vel_topic: /cmd_vel}
  states: {type: joint_state_publisher, rate: 50}
  arm: {type: joint_commands}
  push: {type: external_wrench}
  free: {type: free_joint_state_publisher, topic: /free, publish_rate: 50}
  odometry: {type: odometry, body: base_link}
  lost: {type: odometry, body: base_link, topic: /lost, frame_id: lost, child_frame_id: ghost}
  transforms: {type: transforms, sites: all}
  lidar:
    type: lidar
    scan: {site: lidar, resolution: [180, 1], azimuth_range: [-3.1416, 3.1416], elevation_range: 0, endpoint: false,
           max_range: 12.0, update_rate: 10}
    dome: {site: dome, resolution: [90, 12], azimuth_range: [-3.1416, 3.1416], elevation_range: [-0.4, 0.4],
           max_range: 12.0, update_rate: 5, topic: /points}
  cameras: {type: camera, camera_publish_rate: 5.0, front: {image_topic: /front/image}}
"""


class Robot:
    """What the server reports, without the page."""

    def __init__(self, endpoint):
        self.endpoint = endpoint
        self.client = connect(endpoint)
        self._latest = {}

    def close(self):
        self.client.close()

    def call(self, service, **fields):
        return self.client.call(service, **fields)

    def latest(self, topic):
        """Returns a message of a topic that was published after this call."""
        if topic not in self._latest:
            self.client.wait_for(topic)
            self._latest[topic] = self.client.subscribe(topic, depth=1)
        subscription = self._latest[topic]
        seen = subscription.latest()
        while (message := subscription.next(timeout=TIMEOUT)) is seen:
            pass
        return message

    def joint(self, name):
        """Returns the position of a joint [rad, m]."""
        state = self.latest("/joint_states")
        return state.position[list(state.name).index(name)]

    def body(self, name):
        """Returns position [m], orientation (x, y, z, w), and velocity [m/s] of a body with a free joint."""
        (state,) = (state for state in self.latest("/free").free_joints if state.name == name)
        position, turn = state.pose.pose.position, state.pose.pose.orientation
        velocity = state.twist.twist.linear
        return (
            np.array([position.x, position.y, position.z]),
            np.array([turn.x, turn.y, turn.z, turn.w]),
            np.array([velocity.x, velocity.y, velocity.z]),
        )

    def subscribed(self, key):
        """Whether anybody but the test subscribes to a topic."""
        remote = zenoh.Locality.REMOTE
        with self.client.session.declare_publisher(key, allowed_destination=remote) as publisher:
            return publisher.matching_status.matching


def open_panel(page, title):
    """Unfolds a panel."""
    panel = page.locator("details.panel", has=page.locator("summary .title", has_text=title)).first
    if panel.get_attribute("open") is None:
        panel.locator("summary").first.click()
    return panel


def show(page, topic, on=True):
    """Shows or hides a topic."""
    panel = open_panel(page, "Topics")
    panel.get_by_label(topic, exact=True).set_checked(on)


def status(page, topic):
    """Returns the line below a topic."""
    row = page.locator(".topic", has=page.get_by_label(topic, exact=True))
    return row.locator(".topic-status").inner_text()


def points(page, topic):
    """Returns the points that the page draws for a topic, in the world frame [m], shape (n, 3)."""
    found = page.evaluate(
        """topic => {
            const group = window.mjplug.app.stage.scene.getObjectByName(`topic ${topic}`);
            const found = [];
            group?.traverse((object) => {
                if (!object.isPoints || !object.visible) return;
                object.updateWorldMatrix(true, false);
                const { array } = object.geometry.attributes.position;
                const point = object.position.clone();
                for (let at = 0; at < array.length; at += 3) {
                    found.push(point.fromArray(array, at).applyMatrix4(object.matrixWorld).toArray());
                }
            });
            return found;
        }""",
        topic,
    )
    return np.array(found).reshape(-1, 3)


def drawn(page, topic):
    """Waits until the page draws points of a topic, and returns them in the world frame [m], shape (n, 3)."""
    until(lambda: points(page, topic).size)
    return points(page, topic)
