"""A robot of 40 bodies with a mesh each, about the size of a humanoid."""

BODIES = 40


def meshed_robot() -> str:
    """Returns the MJCF of 40 hinged bodies with a mesh of 2562 vertices each, and of a free box, above a floor."""
    meshes = "".join(
        f'<mesh name="m{i}" builtin="supersphere" params="50 {0.5 + i / BODIES:.3f} 1" scale=".05 .05 .08"/>'
        for i in range(BODIES)
    )
    chains = "".join(_chain(first) for first in range(0, BODIES, 8))
    return f"""
<mujoco model="meshed_robot">
  <option timestep="0.001"/>
  <asset>{meshes}</asset>
  <worldbody>
    <light pos="0 0 4"/>
    <geom name="floor" type="plane" size="5 5 .1"/>
    <body name="box" pos="0 -1 .1"><freejoint/><geom type="box" size=".1 .1 .1" mass="8"/></body>
    {chains}
  </worldbody>
</mujoco>"""


def _chain(first: int) -> str:
    bodies = ""
    for index in reversed(range(first, first + 8)):
        place = f"{first / 40:.2f} 0 2" if index == first else "0 0 -.16"
        bodies = (
            f'<body name="b{index}" pos="{place}"><joint type="hinge" axis="0 1 0" damping=".1"/>'
            f'<geom type="mesh" mesh="m{index}" mass=".5" contype="0" conaffinity="0" rgba=".3 .4 .6 1"/>'
            f"{bodies}</body>"
        )
    return bodies
