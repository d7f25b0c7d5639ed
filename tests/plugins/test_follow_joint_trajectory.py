"""FollowJointTrajectory of JointCommands: tolerances, feedback, cancellation, replacement, and saved states."""

import numpy as np
import pytest

from mjplug.testing import World
from mjplug_plugins.joints import JointCommands
from mjplug_schemas.action_msgs import GoalStatus
from mjplug_schemas.builtin_interfaces import Duration
from mjplug_schemas.control_msgs import JointComponentTolerance, JointTolerance
from mjplug_schemas.control_msgs_action import FollowJointTrajectory
from mjplug_schemas.sensor_msgs import JointState
from mjplug_schemas.trajectory_msgs import JointTrajectory, JointTrajectoryPoint, MultiDOFJointTrajectory

ACTION = "/arm/follow_joint_trajectory"
SUCCEEDED, CANCELED, ABORTED = GoalStatus.STATUS_SUCCEEDED, GoalStatus.STATUS_CANCELED, GoalStatus.STATUS_ABORTED
Result = FollowJointTrajectory.Result

# Two servos without gravity, and a wall that stops the first one at 0.5 rad while it is there.
ARM = """
<mujoco>
  <option timestep="0.002" gravity="0 0 0"/>
  <worldbody>
    <body>
      <joint name="shoulder" axis="0 0 1" damping="2"/>
      <geom name="link" type="capsule" fromto="0 0 0 1 0 0" size="0.05" mass="0.5"/>
      <body pos="0 0 1">
        <joint name="elbow" axis="0 0 1" damping="2"/>
        <geom type="capsule" fromto="0 0 0 0 0 1" size="0.05" mass="0.5" contype="0" conaffinity="0"/>
      </body>
    </body>
    <body name="wall" mocap="true" pos="0 0 -10"><geom type="box" size="0.05 0.05 0.5"/></body>
  </worldbody>
  <actuator>
    <position name="shoulder" joint="shoulder" kp="200"/>
    <position name="elbow" joint="elbow" kp="200"/>
  </actuator>
</mujoco>
"""


@pytest.fixture
def world():
    return new_world()


def new_world(**parameters):
    world = World(ARM)
    world.add(JointCommands, "arm", **parameters)
    return world


def duration(seconds):
    return Duration.from_ns(round(seconds * 1e9))


def goal_of(*points, joints=("shoulder", "elbow"), time=0.0, path=(), goal=()):
    """A goal from points (time, positions) and tolerances (joint, position, velocity)."""
    made = [JointTrajectoryPoint(positions=positions, time_from_start=duration(at)) for at, positions in points]
    tolerances = [
        [JointTolerance(name=name, position=position, velocity=velocity) for name, position, velocity in given]
        for given in (path, goal)
    ]
    return FollowJointTrajectory.Goal(
        trajectory=JointTrajectory(joint_names=joints, points=made),
        path_tolerance=tolerances[0],
        goal_tolerance=tolerances[1],
        goal_time_tolerance=duration(time),
    )


def run(world, goal, seconds):
    """Steps until the goal has ended; returns after how many seconds."""
    for step in range(round(seconds / 0.002)):
        if goal.ended:
            return step * 0.002
        world.step(1)
    assert goal.ended
    return seconds


def put_wall(world):
    world.data.mocap_pos[0] = [0.88 * np.cos(0.7), 0.88 * np.sin(0.7), 0.0]


def positions(world):
    return world.data.qpos.copy()


def test_an_arm_follows_a_goal_and_succeeds_at_its_end(world):
    goal = world.send_goal(ACTION, goal_of((1.0, (0.5, -0.4)), (2.0, (0.2, 0.3))))
    took = run(world, goal, 10.0)
    assert (goal.status, goal.result) == (SUCCEEDED, Result(error_string="Goal successfully reached!"))
    assert took >= 2.0
    assert np.abs(positions(world) - [0.2, 0.3]).max() < 0.02
    # It stays there.
    world.step(1000)
    assert np.abs(positions(world) - [0.2, 0.3]).max() < 1e-3


def test_the_goal_waits_until_the_joints_have_stopped(world):
    """As in joint_trajectory_controller, where the default tolerance of the velocity at the end is 0.01 rad/s."""
    goal = world.send_goal(ACTION, goal_of((0.3, (1.0, 0.0))))
    fast = []
    while not goal.ended:
        fast.append(np.abs(world.data.qvel).max() > 0.01)
        world.step(1)
    assert goal.status == SUCCEEDED
    # The last point is due after 150 steps. The goal succeeds at the first check after it that finds no motion.
    assert len(fast) > 151
    assert all(fast[150:-1])
    assert not fast[-1]


def test_feedback_contains_setpoints_state_and_error_twenty_times_a_second(world):
    goal = world.send_goal(ACTION, goal_of((1.0, (0.5, -1.0))))
    world.step(500)
    assert len(goal.fed_back) == 20
    for number, feedback in enumerate(goal.fed_back, 1):
        time = number * 0.05
        assert feedback.joint_names == ("shoulder", "elbow")
        assert feedback.header.stamp.to_ns() == round(time * 1e9)
        assert feedback.desired.positions == pytest.approx((0.5 * time, -1.0 * time))
        assert feedback.desired.velocities == pytest.approx((0.5, -1.0) if number < 20 else (0.0, 0.0))
        assert feedback.desired.time_from_start.to_ns() == round(time * 1e9)
        for name in ("positions", "velocities"):
            desired, actual, error = (getattr(getattr(feedback, part), name) for part in ("desired", "actual", "error"))
            assert np.subtract(desired, actual) == pytest.approx(error)
    assert goal.fed_back[10].actual.positions[1] < -0.3


def test_a_violated_path_tolerance_aborts_and_holds_the_position(world):
    put_wall(world)
    goal = world.send_goal(ACTION, goal_of((2.0, (1.5, 0.0)), path=[("shoulder", 0.1, 0.0)]))
    took = run(world, goal, 2.0)
    assert (goal.status, goal.result.error_code) == (ABORTED, Result.PATH_TOLERANCE_VIOLATED)
    assert goal.result.error_string.startswith("path tolerance: joint shoulder: the position error is 0.1")
    assert took < 1.9
    held = positions(world)
    assert np.allclose(world.data.ctrl, held, atol=0.01)
    world.step(500)
    assert np.abs(positions(world) - held).max() < 0.05


def test_a_velocity_tolerance_of_the_path_is_checked(world):
    goal = world.send_goal(ACTION, goal_of((0.5, (1.0, 0.0)), path=[("shoulder", 0.0, 0.5)]))
    run(world, goal, 1.0)
    assert goal.result.error_code == Result.PATH_TOLERANCE_VIOLATED
    assert "joint shoulder: the velocity error is 2 rad/s or m/s, the tolerance 0.5" in goal.result.error_string


def test_a_goal_that_is_not_reached_in_time_is_aborted(world):
    put_wall(world)
    goal = world.send_goal(ACTION, goal_of((1.0, (1.5, 0.0)), goal=[("shoulder", 0.05, 0.0)], time=0.5))
    took = run(world, goal, 10.0)
    assert (goal.status, goal.result.error_code) == (ABORTED, Result.GOAL_TOLERANCE_VIOLATED)
    assert "0.502 s after the last point: joint shoulder: the position error is" in goal.result.error_string
    assert took == pytest.approx(1.504, abs=0.003)


def test_without_a_time_limit_the_goal_waits(world):
    put_wall(world)
    goal = world.send_goal(ACTION, goal_of((1.0, (1.5, 0.0)), goal=[("shoulder", 0.05, 0.0)]))
    world.step(2500)
    assert not goal.ended
    world.data.mocap_pos[0] = [0, 0, -10]
    run(world, goal, 5.0)
    assert goal.status == SUCCEEDED


def test_the_configuration_has_the_tolerances_that_a_goal_lacks_and_a_goal_erases_them():
    constraints = {"trajectory": {"shoulder": 0.1}, "goal": {"shoulder": 0.05}, "goal_time": 0.5}
    world = new_world(constraints=constraints)
    put_wall(world)
    goal = world.send_goal(ACTION, goal_of((2.0, (1.5, 0.0))))
    run(world, goal, 2.0)
    assert goal.result.error_code == Result.PATH_TOLERANCE_VIOLATED
    world.reset()
    put_wall(world)
    goal = world.send_goal(ACTION, goal_of((2.0, (1.5, 0.0)), path=[("shoulder", -1.0, 0.0)]))
    run(world, goal, 5.0)
    assert goal.result.error_code == Result.GOAL_TOLERANCE_VIOLATED
    world.reset()
    put_wall(world)
    erased = goal_of((2.0, (1.5, 0.0)), path=[("shoulder", -1.0, 0.0)], goal=[("shoulder", -1.0, -1.0)])
    goal = world.send_goal(ACTION, erased)
    assert run(world, goal, 5.0) == pytest.approx(2.002, abs=0.003)
    assert goal.status == SUCCEEDED


def test_a_cancelled_goal_holds_the_position(world):
    goal = world.send_goal(ACTION, goal_of((2.0, (2.0, 0.0))))
    world.step(500)
    world.cancel_goal(ACTION, goal)
    assert (goal.status, goal.result.error_code) == (CANCELED, 0)
    held = positions(world)
    assert np.allclose(world.data.ctrl, held)
    world.step(1000)
    assert np.abs(positions(world) - held).max() < 0.2
    assert np.allclose(world.data.ctrl, held)


def test_a_goal_can_be_cancelled_while_paused():
    world = World(ARM, paused=True)
    world.add(JointCommands, "arm")
    goal = world.send_goal(ACTION, goal_of((2.0, (2.0, 0.0))))
    world.cancel_goal(ACTION, goal)
    assert goal.status == CANCELED


def test_a_new_goal_replaces_the_old_one(world):
    first = world.send_goal(ACTION, goal_of((2.0, (2.0, 1.0))))
    world.step(250)
    second = world.send_goal(ACTION, goal_of((1.0, (0.0,)), joints=("shoulder",)))
    assert (first.status, first.result.error_code) == (ABORTED, Result.INVALID_GOAL)
    assert first.result.error_string == "the goal was replaced by another command for joint shoulder"
    # The joint that the new goal does not name holds its position.
    held = world.data.qpos[1]
    run(world, second, 5.0)
    assert second.status == SUCCEEDED
    assert world.data.qpos[0] == pytest.approx(0.0, abs=0.02)
    assert world.data.ctrl[1] == pytest.approx(held)


def test_goals_for_different_joints_are_executed_side_by_side(world):
    goals = [world.send_goal(ACTION, goal_of((1.0, (0.5,)), joints=(joint,))) for joint in ("shoulder", "elbow")]
    for goal in goals:
        run(world, goal, 5.0)
    assert [goal.status for goal in goals] == [SUCCEEDED, SUCCEEDED]
    assert np.abs(positions(world) - 0.5).max() < 0.02


def test_another_command_for_a_joint_ends_the_goal(world):
    goal = world.send_goal(ACTION, goal_of((2.0, (2.0, 1.0))))
    world.step(100)
    world.publish("/arm/joint_commands", JointState(name=["elbow"], position=[0.1]))
    assert (goal.status, goal.result.error_code) == (ABORTED, Result.INVALID_GOAL)
    assert goal.result.error_string == "the goal was replaced by another command for joint elbow"


def test_a_trajectory_of_the_topic_has_no_tolerances(world):
    world.publish("/arm/joint_trajectory", goal_of((0.1, (1.0, 1.0))).trajectory)
    world.step(2000)
    assert np.abs(positions(world) - 1.0).max() < 0.02


def test_a_reset_aborts_the_goal_and_its_motion(world):
    goal = world.send_goal(ACTION, goal_of((2.0, (2.0, 1.0))))
    world.step(500)
    world.reset()
    assert (goal.status, goal.result.error_code) == (ABORTED, Result.INVALID_GOAL)
    assert goal.result.error_string == "cancelled: the world was reset"
    world.step(500)
    assert np.abs(positions(world)).max() < 1e-9


@pytest.mark.parametrize("blocked", [False, True])
@pytest.mark.parametrize("after", [250, 600])
def test_a_restored_motion_of_a_goal_ends_like_the_one_that_was_saved(blocked, after):
    """The motion and its tolerances are part of the state; the goal is not, because its client may be gone."""
    tolerances = {"path": [("shoulder", 0.2, 0.0)], "goal": [("shoulder", 0.05, 0.0)], "time": 0.5}
    request = goal_of((1.0, (0.8, 0.4)), **tolerances)

    def begun():
        world = new_world()
        if blocked:
            put_wall(world)
        return world, world.send_goal(ACTION, request)

    world, goal = begun()
    world.step(after)
    state = world.save()
    expected = []
    for _ in range(900):
        world.step(1)
        expected.append((positions(world), world.data.ctrl.copy()))
    ended = (goal.status, goal.result.error_code)
    assert ended == ((ABORTED, Result.PATH_TOLERANCE_VIOLATED) if blocked else (SUCCEEDED, 0))

    for other, late in (begun(), (new_world(), None)):
        other.step(10)
        other.restore(state)
        if late is not None:
            assert (late.status, late.result.error_string) == (ABORTED, "cancelled: a state was restored")
        for qpos, ctrl in expected:
            other.step(1)
            assert (positions(other) == qpos).all()
            assert (other.data.ctrl == ctrl).all()


@pytest.mark.parametrize(
    ("request_", "reason"),
    [
        (goal_of((1.0, (1.0,)), joints=("wrist",)), "unknown commandable joint 'wrist'"),
        (goal_of(), "the trajectory has no points; cancel the goal to stop the joints"),
        (goal_of((1.0, (1.0,))), "the length of points[0].positions is 1, but that of joint_names is 2"),
        (goal_of((1.0, (1.0, np.nan))), "points[0].positions contains nan"),
        (goal_of((1.0, (1.0, 1.0)), (1.0, (2.0, 2.0))), "times must not be negative and must increase"),
        (
            goal_of((1.0, (1.0, 1.0)), path=[("wrist", 0.1, 0.0)]),
            "path_tolerance[0]: joint 'wrist' is not in the trajectory",
        ),
        (
            goal_of((1.0, (1.0, 1.0)), goal=[("elbow", -0.5, 0.0)]),
            "goal_tolerance[0].position is -0.5; it must be positive, 0 for the default, or -1 for no tolerance",
        ),
        (goal_of((1.0, (1.0, 1.0)), goal=[("elbow", np.nan, 0.0)]), "goal_tolerance[0].position is nan; it must"),
        (goal_of((1.0, (1.0, 1.0)), time=-0.5), "goal_time_tolerance is -0.5; it must be positive"),
        (
            FollowJointTrajectory.Goal(multi_dof_trajectory=MultiDOFJointTrajectory(joint_names=("base",))),
            "multi_dof_trajectory must be empty",
        ),
        (
            FollowJointTrajectory.Goal(component_path_tolerance=(JointComponentTolerance(),)),
            "component tolerances must be empty",
        ),
    ],
)
def test_an_invalid_goal_is_rejected_and_moves_nothing(world, request_, reason):
    current = world.send_goal(ACTION, goal_of((2.0, (1.0, 1.0))))
    world.step(100)
    goal = world.send_goal(ACTION, request_)
    assert reason in goal.refusal
    assert not current.ended


def test_an_acceleration_tolerance_is_rejected(world):
    wanted = goal_of((1.0, (1.0, 1.0)))
    tolerance = JointTolerance(name="elbow", acceleration=1.0)
    goal = world.send_goal(ACTION, wanted.model_copy(update={"path_tolerance": (tolerance,)}))
    assert goal.refusal == "path_tolerance[0].acceleration is 1; accelerations are not checked"


def test_an_old_goal_is_rejected(world):
    world.step(1000)
    wanted = goal_of((0.5, (1.0, 1.0)))
    stamp = wanted.trajectory.header.model_copy(update={"stamp": wanted.trajectory.header.stamp.from_ns(1)})
    trajectory = wanted.trajectory.model_copy(update={"header": stamp})
    goal = world.send_goal(ACTION, wanted.model_copy(update={"trajectory": trajectory}))
    assert "the trajectory ends at 0.5 s, but simulated time is 2 s" in goal.refusal
