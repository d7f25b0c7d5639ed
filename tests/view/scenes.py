"""Models for tests of the page."""

ALL_FEATURES = """
<mujoco model="all features">
  <compiler angle="radian"/>
  <option timestep="0.002"/>
  <statistic center="0.4 0.2 0.3" extent="3.2"/>
  <visual>
    <global azimuth="120" elevation="-25" offwidth="1280" offheight="960"/>
    <headlight ambient=".3 .3 .3" diffuse=".4 .4 .4" specular=".2 .2 .2"/>
    <rgba haze=".5 .6 .7 1"/>
    <map zfar="20" force=".03"/>
  </visual>
  <asset>
    <texture name="sky" type="skybox" builtin="gradient" rgb1=".4 .6 .8" rgb2=".1 .1 .2" width="64" height="384"/>
    <texture name="checker" type="2d" builtin="checker" rgb1=".3 .35 .4" rgb2=".5 .55 .6" width="128" height="128"/>
    <texture name="mosaic" type="cube" builtin="flat" mark="cross" rgb1=".9 .5 .1" rgb2=".1 .4 .9" markrgb="1 1 1"
             width="64" height="384"/>
    <texture name="stripes" type="2d" builtin="checker" rgb1=".9 .2 .2" rgb2=".9 .9 .2" width="32" height="16"/>
    <material name="floor" texture="checker" texuniform="true" texrepeat="1 1"/>
    <material name="mosaic" texture="mosaic"/>
    <material name="stripes" texture="stripes" texrepeat="3 2"/>
    <material name="shiny" rgba=".2 .7 .3 1" specular="1" shininess=".9"/>
    <material name="glowing" rgba=".9 .3 .7 1" emission=".6"/>
    <material name="terrain" texture="checker" texrepeat="4 4" rgba=".7 1 .7 1"/>
    <mesh name="wedge" vertex="-.15 -.15 0  .15 -.15 0  .15 .15 0  -.15 .15 0  0 -.15 .3  0 .15 .3"/>
    <mesh name="gem" builtin="sphere" params="1" scale=".18 .18 .25"/>
    <hfield name="hills" nrow="6" ncol="6" size=".5 .5 .3 .1"
            elevation="0 0 0 0 0 0  0 1 2 2 1 0  0 2 3 3 2 0  0 2 3 3 1 0  0 1 2 1 1 0  0 0 0 0 0 0"/>
  </asset>
  <worldbody>
    <light name="sun" type="directional" pos="0 0 5" dir=".3 .2 -1" diffuse=".4 .4 .4" castshadow="false"/>
    <light name="lamp" pos="-2 1 2.5" dir=".6 -.3 -1" cutoff="0.7" exponent="2" diffuse=".5 .4 .3" castshadow="false"/>
    <camera name="fixed" pos="3 -4 2.5" xyaxes=".8 .6 0 -.24 .32 .92"/>
    <geom name="ground" type="plane" size="0 0 .1" material="floor"/>
    <geom name="ramp" type="plane" size=".4 .3 .1" pos="2 1.5 .4" quat=".92 .38 0 0" material="stripes"/>
    <geom name="platform" type="plane" size=".3 .3 .1" pos="2 .4 .6" rgba=".8 .6 .2 1"/>
    <geom name="terrain" type="hfield" hfield="hills" pos="-1.8 -1 .11" material="terrain"/>
    <geom name="sphere" type="sphere" size=".2" pos="-1.2 .3 .2" rgba=".9 .1 .1 1"/>
    <geom name="capsule" type="capsule" size=".1 .2" pos="-.6 .3 .3" rgba=".1 .9 .1 1"/>
    <geom name="ellipsoid" type="ellipsoid" size=".15 .2 .3" pos="0 .3 .3" rgba=".1 .1 .9 1"/>
    <geom name="cylinder" type="cylinder" size=".15 .2" pos=".6 .3 .2" rgba=".9 .9 .1 1"/>
    <geom name="box" type="box" size=".15 .2 .25" pos="1.2 .3 .25" rgba=".1 .9 .9 1"/>
    <geom name="wedge" type="mesh" mesh="wedge" pos="-1.2 -.6 0" rgba=".9 .4 .1 1"/>
    <geom name="gem" type="mesh" mesh="gem" pos="-.6 -.6 .25" material="shiny"/>
    <geom name="glass" type="box" size=".15 .15 .2" pos="0 -.6 .2" rgba=".6 .8 1 .3"/>
    <geom name="cube" type="box" size=".2 .2 .2" pos=".6 -.6 .2" material="mosaic"/>
    <geom name="globe" type="sphere" size=".2" pos="1.2 -.6 .2" material="mosaic"/>
    <geom name="barrel" type="cylinder" size=".15 .2" pos="-1.2 -1.4 .2" material="stripes"/>
    <geom name="pill" type="capsule" size=".12 .15" pos="-.6 -1.4 .27" material="stripes"/>
    <geom name="ball" type="sphere" size=".2" pos="0 -1.4 .2" material="stripes"/>
    <geom name="crate" type="box" size=".15 .2 .2" pos=".6 -1.4 .2" material="stripes"/>
    <geom name="lantern" type="sphere" size=".12" pos="1.2 -1.4 .3" material="glowing"/>
    <geom name="hidden" type="box" size=".2 .2 .2" pos="-.8 .8 .8" group="3" rgba="1 0 0 1"/>
    <site name="mark" type="box" size=".05 .05 .05" pos="0 -.1 .05" rgba="1 0 1 1"/>
    <site name="anchor" pos="-.3 1.2 1.2" size=".04" rgba="1 1 0 1"/>
    <body name="swing" pos="0 1.2 .7"><joint name="swing" axis="0 1 0" damping=".1"/>
      <geom name="arm" type="capsule" fromto="0 0 0 .4 0 0" size=".05" rgba=".8 .5 .8 1"/>
      <site name="tip" pos=".4 0 .1" size=".04" rgba="1 1 0 1"/>
    </body>
    <body name="free" pos="1.2 1.2 .5"><freejoint/>
      <geom name="free" type="box" size=".1 .15 .1" rgba=".4 .4 1 1"/></body>
    <body name="ghost" mocap="true" pos="-1.2 1.2 .5">
      <geom name="ghost" type="sphere" size=".15" rgba="1 1 1 .5" contype="0" conaffinity="0"/></body>
    <flexcomp name="cloth" type="grid" count="7 7 1" spacing=".1 .1 .1" pos="2 -.5 .9" radius=".01" dim="2" mass=".1"
              material="stripes"><pin id="0 6 42 48"/></flexcomp>
    <flexcomp name="jelly" type="grid" count="4 4 4" spacing=".1 .1 .1" pos="2 -1.5 .4" radius=".01" dim="3" mass="1"
              rgba=".3 .8 .6 1"/>
    <flexcomp name="rope" type="grid" count="8 1 1" spacing=".08 .1 .1" pos="-.6 1.8 .8" radius=".02" dim="1" mass=".1"
              rgba=".7 .3 .2 1"><pin id="0 7"/></flexcomp>
  </worldbody>
  <deformable>
    <skin name="cover" rgba=".5 .9 .3 1" vertex="0 1.1 1.6  .4 1.1 1.6  .4 1.3 1.7  0 1.3 1.7" face="0 1 2 0 2 3"
          inflate=".01">
      <bone body="world" bindpos="0 0 0" bindquat="1 0 0 0" vertid="0 3" vertweight="1 1"/>
      <bone body="swing" bindpos="0 1.2 .7" bindquat="1 0 0 0" vertid="1 2" vertweight="1 1"/>
    </skin>
  </deformable>
  <tendon><spatial name="string" width=".015" rgba="1 .5 0 1"><site site="anchor"/><site site="tip"/></spatial></tendon>
</mujoco>
"""
"""Every kind of object that is drawn."""
