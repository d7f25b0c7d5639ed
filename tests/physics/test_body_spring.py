"""The spring of a dragged body against MuJoCo's own viewer functions."""

import mujoco
import numpy as np
import pytest
from conftest import ARM

from mjplug.errors import RequestError
from mjplug.physics.body_spring import BodySpring
from mjplug.physics.simulation import Simulation

PLACES = """
<mujoco>
  <worldbody>
    <body name="wall"><geom size=".1"/></body>
    <body name="hand" mocap="true" pos="1 0 0"><geom size=".1"/><body name="finger" pos="0 0 1"><geom size=".1"/></body>
    </body>
    <body name="robot" pos="0 0 3"><freejoint/><geom type="box" size=".1 .2 .3" pos=".05 0 .02"/>
      <body name="leg" pos=".5 0 0"><joint axis="0 1 0"/><geom type="capsule" size=".05" fromto="0 0 0 .4 0 0"/></body>
    </body>
  </worldbody>
</mujoco>
"""
QUAT = np.array([0.5, -0.5, 0.5, 0.5])


def moving_arm():
    simulation = Simulation(mujoco.MjModel.from_xml_string(ARM), "bent")
    simulation.data.qvel[:] = np.linspace(-1.0, 1.0, simulation.model.nv)
    simulation.checkpoint()
    simulation.advance(20)
    return simulation


def mujocos_perturbation(simulation, body, local):
    """A perturbation as MuJoCo's viewer starts it, with a scene of its own."""
    perturbation = mujoco.MjvPerturb()
    perturbation.select, perturbation.localpos, perturbation.flexselect = body, local, -1
    model, data, scene = simulation.model, simulation.data, mujoco.MjvScene(simulation.model, 100)
    mujoco.mjv_updateScene(model, data, mujoco.MjvOption(), None, mujoco.MjvCamera(), mujoco.mjtCatBit.mjCAT_ALL, scene)
    mujoco.mjv_initPerturb(model, data, scene, perturbation)
    return perturbation


@pytest.mark.parametrize("name", ["lower", "slider", "pendulum", "cube"])
@pytest.mark.parametrize("mode", ["translate", "rotate", "both"])
def test_the_force_is_that_of_mujocos_viewer_and_is_added_to_other_forces(name, mode):
    simulation = moving_arm()
    model, data = simulation.model, simulation.data
    body, local, target = simulation.body_id(name), np.array([0.02, -0.01, 0.03]), np.array([0.4, 0.7, 1.9])
    reference = mujocos_perturbation(simulation, body, local)
    reference.refselpos = target
    mujoco.mju_mulQuat(quat := np.empty(4), QUAT, model.body_iquat[body])
    reference.refquat = quat
    reference.active = {"translate": 1, "rotate": 2, "both": 3}[mode]
    data.xfrc_applied[:] = 0.0
    mujoco.mjv_applyPerturbForce(model, data, reference)
    expected = data.xfrc_applied.copy()
    assert np.abs(expected[body]).max() > 0.1
    other = np.arange(6 * model.nbody, dtype=float).reshape(-1, 6)
    data.xfrc_applied[:] = other
    spring = BodySpring(simulation, body, local)
    spring.set(None if mode == "rotate" else target, None if mode == "translate" else QUAT)
    spring.apply()
    np.testing.assert_allclose(data.xfrc_applied - other, expected, rtol=1e-12, atol=1e-12)


def test_two_springs_on_one_body_add_up():
    simulation = moving_arm()
    force = simulation.data.xfrc_applied
    body, total = simulation.body_id("cube"), np.zeros(6)
    springs = [BodySpring(simulation, body, local) for local in ((0.1, 0, 0), (0, 0.1, 0))]
    for spring, target in zip(springs, ((1, 2, 3), (3, 2, 1)), strict=True):
        spring.set(target, None)
        force[:] = 0.0
        spring.apply()
        total += force[body]
    force[:] = 0.0
    for spring in springs:
        spring.apply()
    np.testing.assert_allclose(force[body], total, rtol=1e-12)


def test_the_spring_pulls_a_free_body_to_the_target_and_settles_there():
    simulation = Simulation(mujoco.MjModel.from_xml_string(ARM.replace("<option ", '<option gravity="0 0 0" ')), "bent")
    data, body = simulation.data, simulation.body_id("cube")
    spring = BodySpring(simulation, body, (0.0, 0.0, 0.0))
    spring.set((2.0, 1.5, 1.0), None)
    farthest = 0.0
    for _ in range(5000):
        simulation.clear_forces()
        spring.apply()
        simulation.checkpoint()
        assert simulation.advance(1) is None
        farthest = max(farthest, data.xpos[body][0])
    np.testing.assert_allclose(data.xpos[body], (2.0, 1.5, 1.0), atol=1e-3)
    # The spring starts at x = 1; critical damping in MuJoCo's units leaves some overshoot.
    assert farthest < 2.3


@pytest.mark.parametrize("name", ["wall", "finger", "world"])
def test_a_body_that_cannot_move_is_refused(name):
    simulation = Simulation(mujoco.MjModel.from_xml_string(PLACES))
    with pytest.raises(RequestError, match=f"body '{name}' cannot be dragged, because it is fixed to the world"):
        BodySpring(simulation, simulation.body_id(name), (0.0, 0.0, 0.0))


@pytest.mark.parametrize("name", ["hand", "robot", "leg"])
@pytest.mark.parametrize("quat", [None, QUAT])
def test_placing_puts_the_point_at_the_target_with_the_orientation(name, quat):
    simulation = Simulation(mujoco.MjModel.from_xml_string(PLACES))
    simulation.data.qpos[7] = 0.3
    simulation.forward()
    body, local, target = simulation.body_id(name), np.array([0.1, 0.2, -0.1]), np.array([1.0, -2.0, 2.5])
    before = simulation.data.xquat[body].copy()
    spring = BodySpring(simulation, body, local)
    spring.set(target, quat)
    spring.place()
    simulation.forward()
    data = simulation.data
    np.testing.assert_allclose(data.xpos[body] + data.xmat[body].reshape(3, 3) @ local, target, atol=1e-12)
    np.testing.assert_allclose(data.xquat[body], before if quat is None else quat, atol=1e-12)
    assert data.qpos[7] == 0.3


def test_placing_a_body_without_a_free_joint_does_nothing():
    simulation = moving_arm()
    before = simulation.data.qpos.copy()
    spring = BodySpring(simulation, simulation.body_id("lower"), (0.0, 0.0, 0.0))
    spring.set((0.0, 0.0, 1.0), None)
    spring.place()
    np.testing.assert_array_equal(simulation.data.qpos, before)
