"""Environments of gymnasium: checked by gymnasium itself, reproducible, and equal over Zenoh and in process."""

import subprocess
import sys

import gymnasium
import numpy as np
import pytest
from camera_scenes import gl  # noqa: F401 - a fixture
from gymnasium.utils.env_checker import check_env

import mjplug.gym
from mjplug.client import RequestRefused
from mjplug.errors import MjplugError
from mjplug.gym import MjplugEnv

CART_POLE = "examples/09_lockstep/cart_pole.xml"
TASKS = ("mjplug/ArmReach-v0", "mjplug/QuadrupedStand-v0")
IGNORED = pytest.mark.filterwarnings("ignore:.*Box observation space (maximum|minimum) value is")


def tilted(random):
    return {"state_overrides": {"joint_states": {"name": ["pivot"], "position": [random.uniform(-0.2, 0.2)]}}}


def balancing(server, **options):
    return MjplugEnv(
        server,
        start=tilted,
        reward=lambda observation, action: 1.0 - observation[1] ** 2,
        terminated=lambda observation: abs(observation[1]) > 0.4,
        steps=5,
        **options,
    )


@pytest.fixture(params=["own", "running", "client"])
def env(request, mjplug_server):
    if request.param == "own":
        env = balancing(CART_POLE)
    else:
        server = mjplug_server(CART_POLE)
        env = balancing(server if request.param == "running" else server.client())
    yield env
    env.close()


def episode(env, seed, steps=30):
    observation, _ = env.reset(seed=seed)
    rows = [observation]
    for i in range(steps):
        observation, reward, terminated, truncated, _ = env.step(np.full(env.action_space.shape, 0.1 * (-1) ** i))
        rows.append(np.append(observation, reward))
        if terminated or truncated:
            break
    return rows


def equal(one, other):
    return len(one) == len(other) and all(np.array_equal(a, b) for a, b in zip(one, other, strict=True))


@IGNORED
@pytest.mark.filterwarnings("ignore:.*(Box action space|Infinity)")
def test_gymnasium_finds_no_fault(env):
    check_env(env, skip_render_check=True)


def test_a_seed_gives_the_same_episode_to_the_bit(env):
    first = episode(env, 7)
    other = episode(env, 8)
    assert equal(episode(env, 7), first)
    assert not equal(other, first)


NOISY = """
<mujoco>
  <worldbody>
    <body><joint name="pivot" axis="0 1 0" damping=".01"/><geom type="capsule" size=".02" fromto="0 0 0 0 0 .5"/>
      <site name="imu"/></body>
  </worldbody>
  <actuator><position joint="pivot" kp="3" kv="1" delay=".011" nsample="9" interp="linear"/></actuator>
  <sensor><gyro name="imu_gyro" site="imu" noise=".02"/><accelerometer name="imu_accel" site="imu" noise=".1"/></sensor>
</mujoco>
"""


class Noisy(MjplugEnv):
    """Observes the IMU as it is published."""

    def observation_of(self, result):
        message = result.message("/sensors/imu/imu")
        vectors = (message.angular_velocity, message.linear_acceleration)
        return np.concatenate([result["qpos"], *([v.x, v.y, v.z] for v in vectors)])


@pytest.fixture(params=["own", "client"])
def noisy(request, mjplug_server, tmp_path):
    (tmp_path / "noisy.xml").write_text(NOISY)
    model, options = tmp_path / "noisy.xml", {"plugins": {"sensors": {"type": "sensors", "noise": True}}}
    given = (model, options) if request.param == "own" else (mjplug_server(model, **options).client(), {})
    env = Noisy(given[0], start=tilted, observe=("qpos",), outputs=["/sensors/imu/imu"], steps=3, **given[1])
    yield env
    env.close()


def test_noise_belongs_to_the_seed_of_an_episode(noisy):
    first = episode(noisy, 7, 40)
    following = [episode(noisy, None, 40) for _ in range(2)]
    assert equal(episode(noisy, 7, 40), first)
    assert equal([episode(noisy, None, 40) for _ in range(2)][1], following[1])
    assert not equal(following[0], following[1])
    # Equal starts, other noise: only the messages differ.
    noisy.driver.save("here", overwrite=True)
    one, other, again = (
        [noisy.reset(seed=seed, options={"state": "here"})[0], noisy.step(np.array([0.2]))[0]] for seed in (1, 2, 1)
    )
    assert equal(one, again)
    assert all(a[0] == b[0] and (a[1:] != b[1:]).all() for a, b in zip(one, other, strict=True))


def test_an_episode_is_the_same_in_process_and_over_zenoh(mjplug_server):
    own = balancing(CART_POLE)
    far = balancing(mjplug_server(CART_POLE).client())
    assert equal(episode(own, 3), episode(far, 3))
    own.close()
    far.close()


def test_an_episode_may_start_from_a_saved_state(env):
    env.reset(seed=1)
    for _ in range(7):
        env.step(np.full(1, 0.3))
    env.driver.save("middle")
    rows = [env.step(np.full(1, -0.3))[0] for _ in range(5)]
    env.reset(seed=4, options={"state": "middle"})
    assert equal([env.step(np.full(1, -0.3))[0] for _ in range(5)], rows)


def test_an_episode_ends_and_rewards_are_those_of_the_user():
    env = balancing(CART_POLE)
    observation, _ = env.reset(seed=1)
    for _ in range(500):
        observation, reward, terminated, truncated, info = env.step(np.zeros(1))
        assert reward == 1.0 - observation[1] ** 2
        assert not truncated
        if terminated:
            break
    assert terminated
    assert abs(observation[1]) > 0.4
    assert info["steps"] % 5 == 0
    env.close()
    env.close()


def test_controls_have_the_limits_of_the_model():
    env = balancing(CART_POLE)
    assert (env.action_space.low.tolist(), env.action_space.high.tolist()) == ([-20.0], [20.0])
    env.close()


def test_a_server_of_somebody_else_stays_open(mjplug_server):
    server = mjplug_server(CART_POLE)
    env = balancing(server.client())
    env.reset(seed=1)
    env.close()
    assert server.running


def test_a_server_is_stopped_if_the_observation_fails_at_the_beginning():
    class Failing(MjplugEnv):
        def observation_of(self, result):
            drivers.append(self.driver)
            raise LookupError("no such joint")

    drivers = []
    with pytest.raises(LookupError, match="no such joint"):
        Failing(CART_POLE)
    with pytest.raises(MjplugError, match="has been stopped"):
        drivers[0].step()


def test_wrong_arguments_are_refused_with_a_sentence(mjplug_server):
    with pytest.raises(MjplugError, match="render_mode is 'human'; it must be 'rgb_array' or None"):
        balancing(CART_POLE, render_mode="human")
    with pytest.raises(MjplugError, match="render_mode 'rgb_array' needs camera"):
        balancing(CART_POLE, render_mode="rgb_array")
    with pytest.raises(MjplugError, match="speed: the server is open already"):
        balancing(mjplug_server(CART_POLE), speed=1.0)
    env = balancing(CART_POLE)
    with pytest.raises(MjplugError, match="unknown options: stte; known: keyframe, state"):
        env.reset(options={"stte": "x"})
    with pytest.raises(RequestRefused, match="unknown keyframe 'hme'"):
        env.reset(options={"keyframe": "hme"})
    with pytest.raises(RequestRefused, match=r"ctrl\[0\] is nan"):
        env.step(np.array([np.nan]))
    env.close()


@IGNORED
@pytest.mark.parametrize("task", TASKS)
def test_bundled_tasks_are_made_by_gymnasium(task):
    env = gymnasium.make(task)
    check_env(env.unwrapped, skip_render_check=True)
    first = episode(env, 11, 10)
    assert equal(episode(env, 11, 10), first)
    env.close()


def test_a_standing_robot_is_rewarded_and_a_fallen_one_ends_the_episode():
    env = gymnasium.make("mjplug/QuadrupedStand-v0").unwrapped
    env.reset(seed=2)
    assert env.step(np.zeros(12))[1] > 0.8
    for _ in range(100):
        _, reward, terminated, _, _ = env.step(np.array([0.0, 3.4, -2.2] * 4))
        if terminated:
            break
    assert reward < 0.6
    env.close()


def test_registering_twice_does_nothing():
    mjplug.gym.register_tasks()
    assert all(task in gymnasium.registry for task in TASKS)


PARALLEL = """
import gymnasium
import numpy as np
from gymnasium.vector import AsyncVectorEnv

if __name__ == "__main__":
    envs = AsyncVectorEnv([lambda: gymnasium.make("mjplug.gym:mjplug/ArmReach-v0")] * 2, context="spawn")
    observations, _ = envs.reset(seed=[5, 5])
    assert observations.shape == (2, 10)
    assert np.array_equal(observations[0], observations[1])
    observations, rewards, *_ = envs.step(np.zeros((2, 2)))
    assert np.array_equal(observations[0], observations[1])
    assert rewards[0] == rewards[1] < 0.0
    envs.close()
"""


@pytest.mark.slow
def test_environments_run_in_parallel_processes(tmp_path):
    program = tmp_path / "parallel.py"
    program.write_text(PARALLEL)
    subprocess.run([sys.executable, program], check=True, timeout=120)


@pytest.mark.usefixtures("gl")
def test_the_camera_shows_the_state_of_the_environment():
    env = gymnasium.make("mjplug/ArmReach-v0", render_mode="rgb_array").unwrapped
    env.reset(seed=1)
    image = env.render()
    assert (image.shape, image.dtype) == ((240, 320, 3), np.uint8)
    assert image.std() > 5.0
    assert np.array_equal(env.render(), image)
    for _ in range(20):
        env.step(np.array([0.6, 0.6]))
    assert not np.array_equal(env.render(), image)
    env.close()
