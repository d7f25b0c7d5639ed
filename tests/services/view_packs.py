"""Reads drawing packs and frames as documented, without the code that writes them."""

import json
import struct

import numpy as np

EVERYTHING = """
<mujoco model="everything">
  <compiler angle="radian"/>
  <asset>
    <texture name="stripes" type="2d" builtin="checker" rgb1="1 0 0" rgb2="0 0 1" width="8" height="4"/>
    <texture name="sky" type="skybox" builtin="gradient" rgb1=".2 .3 .4" rgb2="0 0 0" width="4" height="24"/>
    <material name="striped" texture="stripes" rgba=".9 .8 .7 1" texrepeat="3 2"/>
    <mesh name="tetra" vertex="0 0 0  1 0 0  0 1 0  0 0 1" texcoord="0 0 1 0 0 1 1 1" face="0 2 1 0 1 3 0 3 2 1 2 3"/>
    <mesh name="unused" vertex="0 0 0  1 0 0  0 1 0  0 0 2"/>
    <hfield name="hills" nrow="3" ncol="4" size="1 2 .5 .1" elevation="0 1 2 3 4 5 6 7 8 9 10 11"/>
  </asset>
  <worldbody>
    <light name="sun" pos="0 0 3" dir="0 0 -1"/>
    <geom name="ground" type="plane" size="0 0 .1" material="striped"/>
    <geom name="terrain" type="hfield" hfield="hills" pos="5 0 0"/>
    <body name="post" pos="1 2 3" quat=".5 .5 .5 .5">
      <geom name="glass" type="box" size=".1 .2 .3" rgba="0 1 0 .25"/>
      <site name="tip" pos="0 0 .3" size=".02"/>
      <geom name="hidden" type="mesh" mesh="unused" rgba="1 1 1 0"/>
    </body>
    <body name="arm" pos="0 0 1"><joint name="hinge" axis="0 1 0" range="-1 2" limited="true"/>
      <geom name="link" type="capsule" fromto="0 0 0 .5 0 0" size=".05"/>
      <camera name="eye" pos="0 .1 0"/>
      <body name="hand" pos=".5 0 0"><geom name="palm" type="mesh" mesh="tetra" material="striped"/></body>
    </body>
    <body name="ball" pos="0 3 1"><freejoint/><geom type="sphere" size=".1"/></body>
    <body name="ghost" mocap="true" pos="-1 0 1"><geom type="ellipsoid" size=".1 .2 .3" contype="0" conaffinity="0"/>
      <body name="ghost_child" pos="0 0 1"><geom type="cylinder" size=".1 .2" contype="0" conaffinity="0"/></body>
    </body>
    <flexcomp name="cloth" type="grid" count="3 4 1" spacing=".1 .1 .1" pos="0 -3 2" radius=".01" dim="2" mass="1"/>
  </worldbody>
  <actuator><motor name="torque" joint="hinge" ctrlrange="-3 4" ctrllimited="true"/></actuator>
  <keyframe><key name="up" time="7"/></keyframe>
</mujoco>
"""
"""A model with every kind of object that is drawn."""


class Pack:
    """A drawing pack, taken apart."""

    def __init__(self, content):
        magic, length = struct.unpack_from("<4sI", content)
        assert magic == b"MJV1"
        self.header = json.loads(content[8 : 8 + length])
        self._content = content
        self._start = -(-(8 + length) // 8) * 8

    def array(self, entry):
        count = int(np.prod(entry["shape"]))
        assert entry["offset"] % 8 == 0
        values = np.frombuffer(self._content, f"<{entry['type']}", count, self._start + entry["offset"])
        return values.reshape(entry["shape"])

    def file(self, entry):
        start = self._start + entry["offset"]
        return self._content[start : start + entry["size"]]


class Frame:
    """A frame, taken apart."""

    def __init__(self, content):
        self.time, self.wall_time, self.epoch, self.step, self.flags, bodies, cameras, _, vertices = struct.unpack_from(
            "<ddIIHHHHI", content
        )
        values = np.frombuffer(content, "<f4", offset=36)
        assert len(values) == 7 * bodies + 12 * cameras + 3 * vertices
        self.bodies = values[: 7 * bodies].reshape(bodies, 7)
        self.cameras = values[7 * bodies :][: 12 * cameras].reshape(cameras, 12)
        self.vertices = values[7 * bodies + 12 * cameras :].reshape(vertices, 3)


class State:
    """A state, taken apart."""

    def __init__(self, content):
        self.time, self.wall_time, self.epoch, self.step, self.flags, _, count = struct.unpack_from("<ddIIHHI", content)
        self.values = np.frombuffer(content, "<f8", offset=32)
        assert len(self.values) == count
