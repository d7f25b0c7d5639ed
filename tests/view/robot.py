"""A mobile base with a lidar, a camera and an arm, in a room with walls at known places."""

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
  transforms: {type: transforms, sites: all}
  lidar:
    type: lidar
    scan: {site: lidar, resolution: [180, 1], azimuth_range: [-3.1416, 3.1416], elevation_range: 0, endpoint: false,
           max_range: 12.0, update_rate: 10}
    dome: {site: dome, resolution: [90, 12], azimuth_range: [-3.1416, 3.1416], elevation_range: [-0.4, 0.4],
           max_range: 12.0, update_rate: 5, topic: /points}
  cameras: {type: camera, camera_publish_rate: 5.0, front: {image_topic: /front/image}}
"""
