"""Models for tests of the controls of the page; cheap to draw, because the processor draws them."""

TOYS = """
<mujoco model="toys">
  <option timestep="0.002"/>
  <statistic center="0 0 .5" extent="2"/>
  <worldbody>
    <geom name="floor" type="plane" size="3 3 .1" rgba=".6 .6 .6 1"/>
    <body name="box" pos="0 0 .2"><freejoint name="box"/>
      <geom name="crate" type="box" size=".2 .2 .2" mass="4" rgba=".9 .5 .1 1"/></body>
    <body name="post" pos="1 1 .5"><geom type="box" size=".1 .1 .5" rgba=".2 .4 .8 1"/></body>
    <body name="arm" pos="-1 0 1"><joint name="shoulder" axis="0 1 0" range="-90 90" limited="true" damping="1"/>
      <geom type="capsule" size=".05" fromto="0 0 0 0 0 -.4" rgba=".2 .8 .4 1"/>
      <body name="hand" pos="0 0 -.45"><geom type="sphere" size=".08" rgba=".9 .2 .4 1"/></body></body>
    <camera name="above" pos="0 0 4"/>
  </worldbody>
  <keyframe><key name="lifted" qpos="0 0 1 1 0 0 0 .5"/></keyframe>
</mujoco>
"""
"""A free box, a post that is fixed to the world, and an arm with a limited hinge."""

OTHER = """
<mujoco model="other">
  <worldbody>
    <geom type="plane" size="3 3 .1"/>
    <body name="ball" pos="0 0 .5"><freejoint/><geom type="sphere" size=".2" rgba=".2 .9 .9 1"/></body>
  </worldbody>
</mujoco>
"""
"""Another model, for a server that starts again."""
