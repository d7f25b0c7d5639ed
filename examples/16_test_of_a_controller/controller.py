"""The controller under test: it turns a joint to a target, and compensates the weight of the arm."""

import math

PERIOD = 0.004
"""Time between two commands [s]."""

MAX_EFFORT = 10.0
"""Largest torque [N m]."""


class ElbowController:
    """Computes a torque from each message `sensor_msgs/JointState`.

    Args:
        target: The target angle [rad].
    """

    def __init__(self, target):
        self.target = target

    def command(self, state):
        """Returns the fields of a `std_msgs/Float64MultiArray` with the torque [N m]."""
        angle, velocity = state.position[0], state.velocity[0]
        # The torque that holds the arm: its own weight acts at 0.25 m, the load at 0.5 m.
        weight = 9.81 * (0.4 * 0.25 + 0.5 * 0.5) * math.sin(angle)
        effort = weight + 40.0 * (self.target - angle) - 5.0 * velocity
        return {"data": [min(max(effort, -MAX_EFFORT), MAX_EFFORT)]}
