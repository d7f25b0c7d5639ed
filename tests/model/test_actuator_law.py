import mujoco
import pytest

from mjplug.model.actuator_law import Drives, actuator_law

SCENE = """
<mujoco>
  <worldbody><body><joint name="joint" axis="0 0 1" damping="{damping}"/><geom size=".1"/></body></worldbody>
  <actuator>{actuator}</actuator>
</mujoco>
"""


def model_of(actuator, damping=0.0):
    return mujoco.MjModel.from_xml_string(SCENE.format(actuator=actuator, damping=damping))


@pytest.mark.parametrize(
    ("actuator", "drives"),
    [
        ('<motor joint="joint"/>', Drives.EFFORT),
        ('<general joint="joint" gainprm="5" dyntype="filter" dynprm=".1"/>', Drives.EFFORT),
        ('<general joint="joint" biastype="affine" biasprm="0 0 -2"/>', Drives.EFFORT),
        ('<position joint="joint" kp="30"/>', Drives.POSITION),
        ('<position joint="joint" kp="30" timeconst=".1"/>', Drives.POSITION),
        ('<general joint="joint" gainprm=".5" biastype="affine" biasprm="1 -100 -10"/>', Drives.POSITION),
        ('<velocity joint="joint" kv="7"/>', Drives.VELOCITY),
        ('<intvelocity joint="joint" kp="30" actrange="-1 1"/>', Drives.VELOCITY),
        ('<damper joint="joint" kv="1" ctrlrange="0 1"/>', Drives.OTHER),
        ('<muscle joint="joint" lengthrange="-1 1"/>', Drives.OTHER),
        ('<general joint="joint" gainprm="0"/>', Drives.OTHER),
    ],
)
def test_actuators_are_distinguished_by_what_balances_their_control(actuator, drives):
    assert actuator_law(model_of(actuator), 0).drives is drives


@pytest.mark.parametrize(
    "actuator",
    [
        '<position joint="joint" kp="30" kv="3"/>',
        '<position joint="joint" kp="30" kv="3" timeconst=".05"/>',
        '<general joint="joint" gainprm=".5" biastype="affine" biasprm="2 -30 -3"/>',
    ],
)
def test_a_position_servo_comes_to_rest_at_the_length_that_its_control_asks_for(actuator):
    model = model_of(actuator)
    data = mujoco.MjData(model)
    data.ctrl[0] = actuator_law(model, 0).control(0.7)
    mujoco.mj_step(model, data, 5000)
    assert data.actuator_length[0] == pytest.approx(0.7, abs=1e-6)


@pytest.mark.parametrize(
    "actuator",
    [
        '<velocity joint="joint" kv="7"/>',
        '<general joint="joint" gainprm="7" biastype="affine" biasprm="3 0 -7"/>',
        '<intvelocity joint="joint" kp="30" actrange="-99 99"/>',
    ],
)
def test_a_velocity_servo_reaches_the_velocity_that_its_control_asks_for(actuator):
    model = model_of(actuator, damping=1.0 if "intvelocity" in actuator else 0.0)
    data = mujoco.MjData(model)
    data.ctrl[0] = actuator_law(model, 0).control(0.7)
    mujoco.mj_step(model, data, 2000)
    assert data.qvel[0] == pytest.approx(0.7, rel=1e-3)


@pytest.mark.parametrize("actuator", ['<motor joint="joint"/>', '<general joint="joint" gainprm="5"/>'])
def test_a_motor_exerts_what_its_control_asks_for(actuator):
    model = model_of(actuator)
    data = mujoco.MjData(model)
    data.ctrl[0] = actuator_law(model, 0).control(0.7)
    mujoco.mj_forward(model, data)
    assert data.actuator_force[0] == pytest.approx(0.7)
