import mujoco
import numpy as np
import pytest

from mjplug.config.load import load
from mjplug.config.problem import ConfigError
from mjplug.model.file import load_model
from mjplug.physics.reset import Reset
from mjplug.physics.simulation import Simulation
from mjplug.server.starting_pose import take_starting_pose

QPOS = ".4 -.3 .1  2 0 0 0  1 1 .5 1 0 0 0  -1 1 .5 1 0 0 0"
"""A pose of the arm in conftest; the first quaternion is to be normalised."""


@pytest.fixture
def start(arm_model, tmp_path):
    """Starts a simulation of the arm with the settings in `sim` and an optional start-position file."""

    def start(file=None, **sim):
        if file is not None:
            (tmp_path / "start.xml").write_text(file)
            sim["start_position_file"] = "start.xml"
        lines = "".join(f"  {name}: {value}\n" for name, value in sim.items())
        (tmp_path / "robot.yaml").write_text(f"model: arm.xml\n{'sim:' if sim else ''}\n{lines}")
        loaded = load(tmp_path / "robot.yaml", environ={})
        simulation = Simulation(arm_model, loaded.settings.sim.keyframe)
        take_starting_pose(simulation, loaded)
        return simulation

    return start


def positions(simulation, *joints):
    return [float(simulation.data.joint(joint).qpos[0]) for joint in joints]


def comes_back(simulation):
    """Whether a reset brings the very state back, after the world has moved."""
    before = {name: getattr(simulation.data, name).copy() for name in ("qpos", "qvel", "ctrl", "act", "sensordata")}
    simulation.data.ctrl[:] = 0.9
    simulation.checkpoint()
    simulation.advance(200)
    assert (simulation.data.qpos != before["qpos"]).any()
    Reset().apply(simulation)
    return all((getattr(simulation.data, name) == value).all() for name, value in before.items())


def test_positions_by_joint_are_laid_over_the_default_pose_and_servos_hold_them(start):
    simulation = start(initial_positions="{shoulder: 0.5, extension: 0.05}")
    assert positions(simulation, "shoulder", "elbow", "extension") == [0.5, 0.0, 0.05]
    # The servo of the shoulder gets its target; the elbow's actuator is a motor.
    assert simulation.data.ctrl.tolist() == [0.5, 0.0]
    assert comes_back(simulation)


def test_positions_by_joint_are_laid_over_a_keyframe_whose_other_controls_stay(start):
    simulation = start(keyframe="bent", initial_positions="{shoulder: -0.2}")
    assert positions(simulation, "shoulder", "elbow", "extension") == [-0.2, -0.7, 0.1]
    assert simulation.data.ctrl.tolist() == [-0.2, 0.3]
    assert simulation.data.act.tolist() == [0.25]
    assert comes_back(simulation)


def test_a_keyframe_alone_is_mujoco_s_keyframe(start, arm_model):
    simulation = start(keyframe="bent")
    data = mujoco.MjData(arm_model)
    mujoco.mj_resetDataKeyframe(arm_model, data, 0)
    for name in ("qpos", "qvel", "ctrl", "act"):
        assert (getattr(simulation.data, name) == getattr(data, name)).all()


def test_zeros_are_left_on_request(start):
    simulation = start(initial_positions="{shoulder: 0.5}", hold_initial_pose="false")
    assert simulation.data.ctrl.tolist() == [0.0, 0.0]


def test_a_start_position_file_gives_the_whole_state_in_place_of_the_keyframe(start, caplog):
    file = f'<key name="x" time="7" qpos="{QPOS}" qvel="{"0.1 " * 18}" ctrl="0.2 0.6" act="0.5"/>'
    simulation = start(file, keyframe="bent")
    assert positions(simulation, "shoulder", "elbow", "extension") == [0.4, -0.3, 0.1]
    assert simulation.data.qpos[3:7].tolist() == [1.0, 0.0, 0.0, 0.0]
    assert (simulation.data.qvel == np.full(18, 0.1)).all()
    assert (simulation.data.ctrl.tolist(), simulation.data.act.tolist()) == ([0.2, 0.6], [0.5])
    assert simulation.data.time == 0.0
    assert "replaces keyframe 'bent'" in caplog.text
    assert comes_back(simulation)


def test_a_file_without_controls_lets_servos_hold_its_pose(start):
    simulation = start(f'<key qpos="{QPOS}"/>')
    assert simulation.data.ctrl.tolist() == [0.4, 0.0]
    assert not simulation.data.qvel.any()


@pytest.mark.parametrize(
    ("file", "sentence"),
    [
        ("<key/>", "start.xml:1: <key> has no qpos"),
        (f'\n\n<key qpos="{QPOS}" ctrl="1"/>', "start.xml:3: ctrl has 1 numbers; the model needs 2"),
        ('<key qpos="1 2 3"/>', "start.xml:1: qpos has 3 numbers; the model needs 21"),
        (f'<key qpos="{QPOS}" qvel="{"zero " * 18}"/>', "start.xml:1: qvel contains 'zero', which is not a number"),
        (f'<key qpos="{QPOS.replace(".4", "nan")}"/>', "start.xml:1: qpos contains 'nan'; it must be finite"),
        (
            f'<mujoco><key qpos="{QPOS}"/></mujoco>',
            "start.xml:1: the root element is <mujoco>; a start-position file needs <key",
        ),
        ("<key\n<<", "start.xml:2: not well-formed"),
    ],
)
def test_a_file_that_does_not_fit_is_refused_with_its_place(start, file, sentence):
    with pytest.raises(ConfigError, match=r"robot.yaml:3:24: error: sim.start_position_file: ") as caught:
        start(file)
    assert sentence in str(caught.value)


def test_a_file_that_is_not_there_is_refused(start):
    with pytest.raises(ConfigError, match=r"robot.yaml:3:24: .*there is no file 'gone.xml'"):
        start(start_position_file="gone.xml")


def test_all_wrong_positions_come_out_at_once_with_their_places(start):
    with pytest.raises(ConfigError) as caught:
        start(initial_positions="{sholder: 0.1, shoulder: 2.0, socket: 0.0, elbow: 9.0}")
    text = str(caught.value)
    assert "sim.initial_positions.sholder: unknown joint 'sholder', did you mean 'shoulder'?" in text
    assert "sim.initial_positions.shoulder: 2 is outside the joint's range [-1.5, 1.5]" in text
    assert "sim.initial_positions.socket: it is neither a hinge nor a slide joint" in text
    assert "elbow" not in text.partition("known:")[0]
    assert text.count("robot.yaml:3:") == 3


HELD = """
<mujoco>
  <compiler angle="radian"/>
  <worldbody>
    <body><joint name="a" ref="0.3" axis="0 0 1" range="-2 2"/><geom size=".1"/>
      <body pos=".5 0 0"><joint name="b" axis="0 0 1"/><geom size=".1"/>
        <body pos=".5 0 0"><joint name="c" axis="0 0 1"/><geom size=".1"/></body></body></body>
  </worldbody>
  <tendon><fixed name="t"><joint joint="c" coef="2"/></fixed></tendon>
  <actuator>
    <position joint="a" kp="50" gear="3" kv="1"/>
    <intvelocity joint="b" kp="50" actrange="-9 9"/>
    <general tendon="t" gainprm="2" biastype="affine" biasprm="1 -50 -1" dyntype="filter" dynprm=".1"/>
    <velocity joint="a" kv="1"/>
  </actuator>
</mujoco>
"""


@pytest.mark.parametrize("initial", [{}, {"a": -0.4, "b": 0.8, "c": 0.2}])
def test_every_position_actuator_holds_the_initial_position(initial, tmp_path):
    """With gears, tendons, activations and controls in other units; the robot does not move at all."""
    (tmp_path / "robot.yaml").write_text(f"model: x.xml\nsim: {{initial_positions: {initial}}}\n".replace("'", ""))
    simulation = Simulation(mujoco.MjModel.from_xml_string(HELD))
    take_starting_pose(simulation, load(tmp_path / "robot.yaml", environ={}))
    expected = [initial.get("a", 0.3), initial.get("b", 0.0), initial.get("c", 0.0)]
    simulation.checkpoint()
    simulation.advance(1000)
    assert simulation.data.qpos.tolist() == pytest.approx(expected, abs=1e-9)
    assert simulation.data.ctrl[1] == simulation.data.ctrl[3] == 0.0


def test_a_servo_that_cannot_reach_its_pose_gets_the_nearest_control_and_activation(tmp_path):
    model = mujoco.MjModel.from_xml_string("""
    <mujoco><worldbody><body><joint name="a" type="slide"/><geom size=".1"/></body></worldbody>
      <actuator><position joint="a" kp="5" timeconst=".5" ctrlrange="-.2 .2"/></actuator></mujoco>""")
    (tmp_path / "robot.yaml").write_text("model: x.xml\nsim: {initial_positions: {a: 0.5}}\n")
    simulation = Simulation(model)
    take_starting_pose(simulation, load(tmp_path / "robot.yaml", environ={}))
    assert (simulation.data.ctrl[0], simulation.data.act[0]) == (0.2, 0.2)


def test_the_quadruped_stands_without_a_keyframe(tmp_path):
    (tmp_path / "robot.yaml").write_text("model: bundled:quadruped\n")
    heights = []
    for held in ("true", "false"):
        simulation = Simulation(load_model("bundled:quadruped").model)
        loaded = load(tmp_path / "robot.yaml", sets=[f"sim.hold_initial_pose={held}"], environ={})
        take_starting_pose(simulation, loaded)
        simulation.checkpoint()
        simulation.advance(1500)
        heights.append(float(simulation.data.qpos[2]))
    assert heights[0] == pytest.approx(0.307, abs=0.02)
    # MuJoCo's zeros stretch the legs away, and it falls.
    assert abs(heights[1] - 0.307) > 0.05
