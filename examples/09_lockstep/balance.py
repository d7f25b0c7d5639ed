"""Balances the pole in lockstep: sends a force, requests five steps, reads the state, and repeats.

Usage: python balance.py      (connects to MJPLUG_CONNECT, by default to tcp/127.0.0.1:7447)
"""

from mjplug.client import connect

GAINS = (2.0, 3.0, 40.0, 7.0)
"""Gains of cart position [N/m], cart velocity [N·s/m], pole angle [N/rad] and pole velocity [N·s/rad]."""


def decide(position, velocity):
    """Returns the force on the cart [N] that brings the pole upright and the cart to 0."""
    state = (position[0], velocity[0], position[1], velocity[1])
    return sum(gain * value for gain, value in zip(GAINS, state, strict=True))


with connect() as client:
    states = client.subscribe("/joint_states")
    motor = client.publisher("/force")
    force = 0.0
    for turn in range(400):
        motor.publish({"data": [force]})
        client.call("~/step_simulation", steps=5)
        state = states.next(timeout=5.0)
        force = decide(state.position, state.velocity)
        if turn % 100 == 99:
            print(f"t = {state.header.stamp.sec + state.header.stamp.nanosec / 1e9:.2f} s: "
                  f"cart at {state.position[0]:+.3f} m, pole at {state.position[1]:+.4f} rad")  # fmt: skip
    print("the last state:", *map(float.hex, [*state.position, *state.velocity]))
