"""Bodies that sleep, and a divergence: the simulation returns to the state before the step that diverged."""

import mujoco
import numpy as np
import pytest

from mjplug.physics import physics_state
from mjplug.physics.checkpoint import Checkpoint
from mjplug.testing import World

# The ball reaches the sleeping box after 437 steps of free fall.
SCENE = """
<mujoco>
  <option timestep="0.002"><flag sleep="enable"/></option>
  <worldbody>
    <geom type="plane" size="9 9 .1"/>
    <body name="box" pos="0 0 .1"><freejoint/><geom type="box" size=".1 .1 .1"/>
      <site name="box" type="box" size=".11 .11 .11"/></body>
    <body name="other" pos="3 0 .1"><freejoint/><geom type="box" size=".1 .1 .1"/></body>
    <body name="ball" pos=".03 .02 4"><freejoint/><geom size=".05"/></body>
    <body name="runaway" pos="0 5 3"><joint name="rail" type="slide"/>
      <geom size=".1" contype="0" conaffinity="0"/></body>
  </worldbody>
  <actuator><general joint="rail" dyntype="integrator" gainprm="1e15"/></actuator>
  <sensor><framepos objtype="body" objname="box"/><touch site="box"/></sensor>
</mujoco>
"""


def diverged(batched, ctrl):
    """A world that diverged some steps after the ball woke the box, and what it did when that was repaired."""
    world = World(SCENE)
    world.step(400)
    assert (world.data.tree_asleep >= 0).tolist() == [True, True, False, False]
    world.data.ctrl[0] = ctrl
    while not world.loop.recovery.count:
        world.loop.step(300 if batched else 1)
    rewound = world.simulation.step, world.data.tree_asleep.tolist(), world.data.tree_awake.tolist()
    poses = world.data.xpos[1].copy()
    world.data.ctrl[0] = world.data.act[0] = world.data.qvel[-1] = 0.0
    rows = []
    for _ in range(400):
        world.loop.step(1)
        rows.append((*world.data.qpos, *world.data.qvel, *world.data.sensordata, *world.data.tree_asleep))
    return rewound, poses, np.array(rows)


@pytest.mark.parametrize("ctrl", [4e-4, 2.5e-4, 1e-4])
def test_bodies_sleep_after_a_divergence_as_before_the_step_that_diverged(ctrl):
    single, batched = diverged(False, ctrl), diverged(True, ctrl)
    assert batched[0] == single[0]
    assert np.array_equal(batched[1], single[1])
    assert np.array_equal(batched[2], single[2])


def test_a_body_that_was_woken_after_the_checkpoint_sleeps_again():
    world = World(SCENE)
    world.step(400)
    model, data = world.model, world.data
    checkpoint = Checkpoint(model, data)
    checkpoint.save()
    results = {name: array.copy() for name, array in physics_state.result_arrays(data).items()}
    before = data.tree_asleep.copy(), data.ntree_awake, data.nbody_awake, data.dof_awake_ind[: data.nv_awake].copy()
    mujoco.mj_step(model, data, 60)
    assert data.tree_asleep[0] < 0
    assert not np.array_equal(data.xpos[1], results["xpos"][1])
    checkpoint.restore()
    after = data.tree_asleep, data.ntree_awake, data.nbody_awake, data.dof_awake_ind[: data.nv_awake]
    assert all(np.array_equal(one, other) for one, other in zip(before, after, strict=True))
    assert np.array_equal(data.xpos[1], results["xpos"][1])
    mujoco.mj_step(model, data)
    # The pose of the box still equals its position, so it is not woken.
    assert data.tree_asleep[0] >= 0
    assert np.array_equal(data.geom_xpos[1], results["geom_xpos"][1])


def test_a_body_that_slept_elsewhere_at_an_earlier_checkpoint_keeps_its_pose():
    world = World(SCENE)
    world.step(400)
    model, data = world.model, world.data
    checkpoint = Checkpoint(model, data)
    checkpoint.save()
    data.qpos[7] = 3.2
    mujoco.mj_step(model, data, 30)
    assert data.tree_asleep.tolist()[1] == 1
    checkpoint.save()
    pose = data.xpos[2].copy()
    data.qpos[7] = 2.5
    mujoco.mj_step(model, data, 3)
    checkpoint.restore()
    assert np.array_equal(data.xpos[2], pose)
    assert data.tree_asleep[1] == 1


def test_results_are_copied_only_when_others_sleep():
    world = World(SCENE)
    checkpoint = Checkpoint(world.model, world.data)
    copied = []
    for _ in range(450):
        checkpoint.save()
        copied.append(id(checkpoint._sleeping._copies))
        mujoco.mj_step(world.model, world.data)
    # None sleeps; one box sleeps; both sleep; one is awake again.
    assert 2 <= len(set(copied)) <= 4


def test_a_model_without_joints_has_a_checkpoint():
    text = '<mujoco><option><flag sleep="enable"/></option><worldbody><geom size="1"/></worldbody></mujoco>'
    model = mujoco.MjModel.from_xml_string(text)
    checkpoint = Checkpoint(model, mujoco.MjData(model))
    checkpoint.save()
    assert checkpoint.restore()
