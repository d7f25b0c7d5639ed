"""Trains a policy that balances a pole, with CMA-ES, in an environment of gymnasium whose physics is a server.

Usage: python train.py [--picture FILE]

Needs the extra `gym`, and the packages cma and matplotlib.
"""

import argparse
from pathlib import Path

import cma
import numpy as np
from gymnasium.wrappers import TimeLimit

import mjplug
from mjplug.gym import MjplugEnv

GENERATIONS, CANDIDATES, EPISODES = 15, 8, 2
"""Numbers of generations, of candidates in each, and of episodes of each candidate."""

ACTIONS = 150
"""Maximum number of actions of an episode, of 20 ms each."""

SCALE = np.array([5.0, 5.0, 20.0, 5.0])
"""Size of a weight of 1: force per position [N/m, N/rad] and per velocity of cart and pole."""


def start(random):
    """Returns a random start: the cart beside the middle, and the pole tilted."""
    position = [random.uniform(-0.2, 0.2), random.uniform(-0.2, 0.2)]
    return {"state_overrides": {"joint_states": {"name": ["rail", "pivot"], "position": position}}}


def reward(observation, action):
    """Returns 1 for an upright pole in the middle, and less otherwise."""
    x, angle = observation[:2]
    return 1.0 - 0.5 * (x / 1.2) ** 2 - 0.5 * (angle / 0.5) ** 2


def has_fallen(observation):
    """Returns whether the episode ends: the pole has fallen, or the cart is at the end of the rail."""
    x, angle = observation[:2]
    return abs(x) > 1.2 or abs(angle) > 0.5


def episode(env, weights, seed):
    """Returns the sum of rewards of an episode, and the angles of the pole [rad]."""
    observation, _ = env.reset(seed=seed)
    total, angles, ended = 0.0, [observation[1]], False
    while not ended:
        force = np.clip([weights * SCALE @ observation], env.action_space.low, env.action_space.high)
        observation, gained, terminated, truncated, _ = env.step(force)
        total, ended = total + gained, terminated or truncated
        angles.append(observation[1])
    return total, angles


def train(env):
    """Returns the mean weights after each generation, and the rewards of all candidates, shape (generations, n)."""
    search = cma.CMAEvolutionStrategy(np.zeros(4), 0.5, {"popsize": CANDIDATES, "seed": 1, "verbose": -9})
    means, rewards = [], []
    for generation in range(GENERATIONS):
        candidates = search.ask()
        seeds = [EPISODES * generation + i for i in range(EPISODES)]
        gained = [np.mean([episode(env, weights, seed)[0] for seed in seeds]) for weights in candidates]
        search.tell(candidates, [-value for value in gained])
        means.append(search.result.xfavorite)
        rewards.append(gained)
        if generation % 2 == 0:
            print(f"generation {generation + 1:2}: mean reward {np.mean(gained):5.1f}, best {np.max(gained):5.1f}")
    return means, np.array(rewards)


def draw(path, rewards, angles):
    """Draws the rewards of all generations, and the angle of the pole with three policies."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    figure, (left, right) = plt.subplots(1, 2, figsize=(12, 4), layout="constrained")
    generations = np.arange(1, len(rewards) + 1)
    left.fill_between(generations, rewards.min(axis=1), rewards.max(axis=1), color="#2a6fb0", alpha=0.2, lw=0)
    left.plot(generations, rewards.mean(axis=1), color="#2a6fb0", lw=2.2)
    left.set(xlabel="generation", title=f"Reward: mean and range of {CANDIDATES} candidates", ylim=(0, ACTIONS))
    for (label, values), colour in zip(angles.items(), ("#9aa3ac", "#e0a030", "#e8690b"), strict=True):
        right.plot(0.02 * np.arange(len(values)), np.degrees(values), color=colour, lw=2.2, label=label)
    right.set(xlabel="simulated time [s]", title="Pole, 0 is upright [degrees]", xlim=(0, 0.02 * ACTIONS))
    right.legend(frameon=False)
    for axes in (left, right):
        axes.grid(color="#e3e6e9")
        axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(path, dpi=120)


def main():
    """Trains, and shows the trained policy."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--picture")
    picture = parser.parse_args().picture
    config = Path(__file__).with_name("config.yaml")
    with mjplug.open_server(config, run=False) as server:
        env = TimeLimit(MjplugEnv(server, start=start, reward=reward, terminated=has_fallen, steps=10), ACTIONS)
        means, rewards = train(env)
        # Starts that were not used in the training.
        totals = [episode(env, means[-1], seed)[0] for seed in range(1000, 1010)]
        print(f"ten new starts: mean reward {np.mean(totals):.1f} of {ACTIONS}, the worst {np.min(totals):.1f}")
        if picture:
            shown = {
                "untrained": np.zeros(4),
                "after 3 generations": means[2],
                f"after {GENERATIONS} generations": means[-1],
            }
            draw(picture, rewards, {label: episode(env, weights, 1000)[1] for label, weights in shown.items()})


main()
