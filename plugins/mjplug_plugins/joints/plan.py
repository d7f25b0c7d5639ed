"""Trajectories as messages contain them, checked. Used on other threads too, so nothing here depends on the state."""

from collections.abc import Sequence
from dataclasses import dataclass

from mjplug.plugin import RequestError
from mjplug_plugins.joints.outputs import MAX_VALUE
from mjplug_schemas.builtin_interfaces import Duration, Time
from mjplug_schemas.trajectory_msgs import JointTrajectory, JointTrajectoryPoint

SECOND = 1_000_000_000

_MAX_START_DELAY = 86_400 * SECOND
"""Longest time until a motion starts [ns]; a later stamp is probably wall time, not simulated time."""


@dataclass(frozen=True, slots=True)
class Plan:
    """The points of a trajectory.

    Attributes:
        times: The time of each point after the start [ns]; empty for a trajectory that stops its joints.
        points: The points.
        stamp: Simulated time of the start [ns]; 0 means at once.
    """

    times: Sequence[int]
    points: Sequence[JointTrajectoryPoint]
    stamp: int

    def begin(self, now: int) -> int:
        """Returns the simulated time of the start [ns].

        Args:
            now: Simulated time [ns].

        Raises:
            RequestError: The trajectory is over, or starts too late.
        """
        begin = self.stamp or now
        if begin + self.times[-1] < now:
            raise RequestError(
                f"the trajectory ends at {(begin + self.times[-1]) / SECOND:g} s, but simulated time is "
                f"{now / SECOND:g} s; a zero stamp starts it immediately"
            )
        if begin > now + _MAX_START_DELAY:
            raise RequestError(
                f"header.stamp is {begin / SECOND:g} s, but simulated time is {now / SECOND:g} s; "
                "set it to simulated time (use_sim_time), or to zero to start immediately"
            )
        return begin


def plan_of(trajectory: JointTrajectory) -> Plan:
    """Returns the plan of a trajectory.

    Raises:
        RequestError: A value is invalid; the message says which.
    """
    count = len(trajectory.joint_names)
    times: list[int] = []
    for index, point in enumerate(trajectory.points):
        if not point.positions:
            raise RequestError(f"points[{index}] has no positions")
        for name in ("positions", "velocities", "accelerations"):
            values = getattr(point, name)
            if values and len(values) != count:
                raise RequestError(
                    f"the length of points[{index}].{name} is {len(values)}, but that of joint_names is {count}"
                )
            # The sum detects NaN too and is fast.
            if not sum(map(abs, values)) <= MAX_VALUE:
                for wrong in (value for value in values if not abs(value) <= MAX_VALUE):
                    raise RequestError(
                        f"points[{index}].{name} contains {wrong:g}; numbers must be finite and below {MAX_VALUE:g}"
                    )
        time = ns(point.time_from_start)
        if time <= (times[-1] if times else -1):
            raise RequestError(
                f"points[{index}].time_from_start is {time / SECOND:g} s; times must not be negative and must increase"
            )
        times.append(time)
    return Plan(tuple(times), trajectory.points, ns(trajectory.header.stamp))


def ns(value: Time | Duration) -> int:
    """Returns a time or duration [ns]."""
    return value.sec * SECOND + value.nanosec
