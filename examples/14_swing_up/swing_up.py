"""Swings a pole up with a motor that is too weak to lift it at once, by model predictive path integral control (MPPI).

Usage: python swing_up.py [ENDPOINT] [--picture FILE]

Every 20 ms of simulated time, the client lets the server simulate random variations of the present plan in copies of
the state, and takes a mean of them as the new plan, in which good ones count most. The endpoint may also be given in
MJPLUG_CONNECT. With --picture, the server needs a camera (camera.yaml), and the client draws what happened.
"""

import argparse

import numpy as np

from mjplug.client import connect

PLANS = 48
"""Number of simulated plans."""

ACTIONS, STEPS = 60, 4
"""Number of actions of a plan, and physics steps of each; 1.2 s altogether."""

CYCLES = 300
LIMIT = 4.0
"""Largest force of the motor [N]."""

SPREAD = 0.6 * LIMIT
"""Standard deviation of the random changes [N]."""

TEMPERATURE = 0.3
"""The smaller it is, the more the best plans count."""

IMAGE = "/camera/side/color"


def cost(qpos, qvel, force):
    """Returns the cost of each state, shape (...,): small if the pole is upright and the cart is in the middle."""
    x, angle = qpos[..., 0], qpos[..., 1]
    speed, turning = qvel[..., 0], qvel[..., 1]
    down = 1.0 - np.cos(angle)
    still = 0.01 * turning**2 * np.exp(-4.0 * down)
    return down + 0.3 * x**2 + 0.02 * speed**2 + still + 1e-3 * (force[..., 0] / LIMIT) ** 2


def variations(plan, random):
    """Returns plans around a plan, shape (PLANS, ACTIONS, 1): itself, similar ones, and more different ones."""
    knots = random.normal(size=(PLANS, ACTIONS // 5, 1)) * SPREAD
    knots[: PLANS // 3] *= 0.2
    knots[0] = 0.0
    # Lines between the knots, because a force that only trembles moves nothing.
    place = np.linspace(0.0, knots.shape[1] - 1.0, ACTIONS)
    left = np.minimum(place.astype(int), knots.shape[1] - 2)
    share = (place - left)[:, None]
    return np.clip(plan + (1.0 - share) * knots[:, left] + share * knots[:, left + 1], -LIMIT, LIMIT)


def improved(client, plan, random):
    """Returns a better plan, and the mean cost of a state in the best plan."""
    plans = variations(plan, random)
    ends = client.simulate(plans, n=STEPS)
    costs = cost(ends["qpos"], ends["qvel"], plans).sum(axis=1)
    weights = np.exp((costs.min() - costs) / TEMPERATURE)
    return np.tensordot(weights / weights.sum(), plans, axes=1), costs.min() / ACTIONS


def main():
    """Plans and acts; prints what happened."""
    parser = argparse.ArgumentParser()
    parser.add_argument("endpoint", nargs="?")
    parser.add_argument("--picture")
    arguments = parser.parse_args()
    random, plan = np.random.default_rng(1), np.zeros((ACTIONS, 1))
    outputs = [IMAGE] if arguments.picture else []
    forces, rows, images = [], [], []
    with connect(arguments.endpoint) as client:
        for cycle in range(CYCLES):
            plan, expected = improved(client, plan, random)
            forces.append(plan[0, 0])
            result = client.step(STEPS, ctrl=plan[0], outputs=outputs if cycle % 5 == 4 else [])
            (x, angle), time = result["qpos"], result.time_ns / 1e9
            rows.append((time, x, angle, expected))
            if result.samples:
                images.append((time, result.message(IMAGE)))
            if cycle % 50 == 49:
                up = 1.0 - abs((angle / np.pi) % 2.0 - 1.0)
                print(f"t = {time:.0f} s: pole {180.0 * up:5.1f} degrees from upright, expected cost {expected:.3f}")
            plan = np.vstack([plan[1:], np.zeros((1, 1))])
        print("digest:", client.call("~/get_state_digest").digest)
    np.savetxt("forces.txt", forces, fmt="%s")
    print("the largest force was", f"{np.abs(forces).max():.1f} N; all are in forces.txt")
    if arguments.picture:
        from picture import draw

        draw(np.array(rows), images, arguments.picture)


main()
