"""Small robots for the tests of joints, one for each way in which joints can be driven."""

import mujoco
import numpy as np

MIXED = """
<mujoco>
  <compiler angle="radian"/>
  <option timestep="0.002" integrator="implicitfast"/>
  <worldbody>
    <body name="cart" pos="0 0 1"><joint name="rail" type="slide" axis="1 0 0" damping="1"/>
      <geom type="box" size=".1 .1 .05" mass="1"/>
      <body name="upper"><joint name="shoulder" axis="0 1 0" damping=".1" armature=".01"/>
        <geom type="capsule" size=".03" fromto="0 0 0 0 0 -.4" mass=".5"/>
        <body name="lower" pos="0 0 -.4"><joint name="elbow" axis="0 1 0" damping=".1" armature=".01"/>
          <geom type="capsule" size=".03" fromto="0 0 0 0 0 -.3" mass=".3"/>
          <body name="hand" pos="0 0 -.3"><joint name="wrist" axis="0 1 0" damping=".05" armature=".005"/>
            <geom type="capsule" size=".02" fromto="0 0 0 0 0 -.1" mass=".1"/></body></body></body></body>
    <body name="bob" pos="2 0 1"><joint name="loose" axis="0 1 0"/><geom size=".05" pos="0 0 -.3"/></body>
    <body name="ball" pos="4 0 1"><joint name="socket" type="ball"/><geom size=".05" pos="0 0 -.3"/></body>
    <body name="cube" pos="6 0 1"><freejoint name="cube_free"/><geom size=".05"/></body>
  </worldbody>
  <actuator>
    <velocity name="rail_drive" joint="rail" kv="50" ctrlrange="-2 2"/>
    <position name="shoulder_servo" joint="shoulder" kp="100" kv="5" ctrlrange="-1.5 1.5"/>
    <motor name="elbow_motor" joint="elbow" gear="4" forcerange="-5 5"/>
    <motor name="wrist_motor" joint="wrist"/>
  </actuator>
</mujoco>
"""
"""A rail with a velocity servo, a shoulder with a position servo, two joints with motors, three that nothing drives."""

GRIPPER = """
<mujoco>
  <option timestep="0.002" gravity="0 0 0"/>
  <worldbody>
    <body name="left" pos="0 .1 0"><joint name="finger_joint1" type="slide" axis="0 1 0" range="0 .04" damping="20"/>
      <geom size=".01" mass=".05"/></body>
    <body name="right" pos="0 -.1 0"><joint name="finger_joint2" type="slide" axis="0 -1 0" range="0 .04" damping="20"/>
      <geom size=".01" mass=".05"/></body>
  </worldbody>
  <tendon><fixed name="split"><joint joint="finger_joint1" coef=".5"/><joint joint="finger_joint2" coef=".5"/></fixed>
  </tendon>
  <equality><joint joint1="finger_joint1" joint2="finger_joint2" solref=".005 1"/></equality>
  <actuator>
    <general name="actuator8" tendon="split" ctrlrange="0 255" gainprm="0.01568627451" biastype="affine"
      biasprm="0 -100 -10"/>
  </actuator>
</mujoco>
"""
"""A gripper as the Franka hand has it: one actuator on a tendon, whose control counts from 0 to 255."""


def compiled(xml):
    return mujoco.MjModel.from_xml_string(xml)


def stepped(model, data, controls):
    """Steps a bare MuJoCo simulation, with the controls given row by row."""
    for row in controls:
        data.ctrl[:] = row
        mujoco.mj_step(model, data)
    return data


def recorded(world, steps):
    """Takes steps and returns the controls of each, shape (steps, nu)."""
    rows = []
    for _ in range(steps):
        world.loop.step(1)
        rows.append(world.data.ctrl.copy())
    return np.array(rows)
