"""The running trajectories and the joints that each of them moves."""

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mjplug.plugin import Host, RequestError
from mjplug.plugin.bundled import quoted
from mjplug_plugins.joints.drives import JointDrives
from mjplug_plugins.joints.outputs import Drive, refuse_both_sides
from mjplug_plugins.joints.plan import Plan, plan_of
from mjplug_plugins.joints.saved_motion import motion_arrays, motion_of
from mjplug_plugins.joints.tolerances import Tolerances
from mjplug_plugins.joints.track import Result, Track
from mjplug_plugins.joints.trajectory import Motion
from mjplug_schemas.trajectory_msgs import JointTrajectory

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Command:
    """A checked trajectory.

    Attributes:
        plan: Its points.
        drives: Its joints.
    """

    plan: Plan
    drives: list[Drive]


class Trajectories:
    """Starts, replaces and executes trajectories. At most one of them moves a joint.

    Attributes:
        running: Whether a trajectory moves any joint.

    Args:
        host: Provides the time and the state.
        joints: The commandable joints.
        from_desired: Whether a motion starts at the last commanded position instead of the current position.
    """

    def __init__(self, host: Host, joints: JointDrives, from_desired: bool) -> None:
        self._host, self._joints, self._from_desired = host, joints, from_desired
        self._tracks: list[Track] = []
        # Motions that have ended. `checked` releases them, because freeing a long plan takes as long as some steps.
        self._ended: deque[Motion] = deque()
        self.running = False

    @property
    def count(self) -> int:
        """Number of joints that a trajectory moves."""
        return sum(len(track.drives) for track in self._tracks)

    def checked(self, trajectory: JointTrajectory) -> Command:
        """Returns the command of a message. May be called on any thread.

        Raises:
            RequestError: The trajectory is invalid.
        """
        self._ended.clear()
        drives = self._find_drives(trajectory)
        return Command(plan_of(trajectory), drives)

    def start(self, command: Command, tolerances: Tolerances | None = None) -> Track | None:
        """Starts a trajectory; one without points stops its joints at their current positions.

        Args:
            command: The result of `checked`.
            tolerances: The tolerances of a goal; None executes the motion without a goal.

        Returns:
            The track; None if there are no points.

        Raises:
            RequestError: The trajectory is over or begins too late; the joints continue as before.
        """
        plan, drives, data = command.plan, command.drives, self._host.data
        if not plan.points:
            for drive in drives:
                self.drop(drive)
                drive.command("position", drive.joint.position(data))
            return None
        now = self._host.time_ns
        begin = plan.begin(now)
        position = np.array([drive.joint.position(data) for drive in drives])
        velocity = np.array([drive.joint.velocity(data) for drive in drives])
        if self._from_desired:
            self._use_desired(drives, position, velocity)
        motion = Motion(plan, begin, now, position, velocity)
        for drive in drives:
            self.drop(drive)
        track = Track(motion, {drive: index for index, drive in enumerate(drives)}, tolerances)
        self._tracks.append(track)
        self.running = True
        return track

    def drop(self, drive: Drive) -> None:
        """Removes a joint, which gets another command, and the other side of its transmission, from its trajectory.

        This ends the goal of the trajectory.
        """
        if not self.running:
            return
        for track in self._tracks:
            count = len(track.drives)
            for moved in (drive, *drive.others):
                track.drives.pop(moved, None)
            if len(track.drives) < count and track.tolerances is not None:
                reason = f"the goal was replaced by another command for joint {drive.joint.name}"
                self.hold(track, Result(error_code=Result.INVALID_GOAL, error_string=reason))
        self._remove_finished()

    def hold(self, track: Track, result: Result) -> None:
        """Ends a motion; its joints hold their current positions.

        Args:
            track: The motion; if it has ended already, nothing happens.
            result: The result of its goal.
        """
        for drive in track.drives:
            drive.command("position", drive.joint.position(self._host.data))
        track.end(result)
        self._remove_finished()

    def clear(self) -> None:
        """Stops all trajectories."""
        self._tracks.clear()
        self.running = False

    def save(self) -> dict[str, Any]:
        """Returns the running motions as data."""
        now = self._host.time_ns
        saved: dict[str, Any] = {"tracks": [], "tolerances": []}
        for number, track in enumerate(self._tracks):
            saved["tracks"].append({drive.joint.name: index for drive, index in track.drives.items()})
            tolerances = None if track.tolerances is None else track.tolerances.save()
            saved["tolerances"].append(tolerances)
            saved |= {f"track{number}_{name}": array for name, array in motion_arrays(track.motion, now).items()}
        return saved

    def restored(self, saved: Mapping[str, Any]) -> list[Track]:
        """Returns the motions in what `save` has returned.

        Raises:
            RequestError: The data are invalid.
        """
        tracks: list[Track] = []
        no_tolerances = [None] * len(saved["tracks"])
        for number, indices in enumerate(saved["tracks"]):
            begin = f"track{number}_"
            arrays = {name.removeprefix(begin): array for name, array in saved.items() if name.startswith(begin)}
            tolerances = saved.get("tolerances", no_tolerances)[number]
            motion = motion_of(arrays, self._host.time_ns, ended=tolerances is not None)
            drives = {self._joints.find(name): int(index) for name, index in indices.items()}
            width = len(motion.points[0].positions)
            if not all("position" in drive.outputs and 0 <= index < width for drive, index in drives.items()):
                raise RequestError("a trajectory moves other joints")
            limits = None if tolerances is None else Tolerances.restored(tolerances, width)
            if limits is not None and sorted(drives.values()) != list(range(width)):
                raise RequestError("the trajectory of a goal lacks joints")
            tracks.append(Track(motion, drives, limits))
        return tracks

    def resume(self, tracks: list[Track]) -> None:
        """Replaces the running motions."""
        self._tracks = tracks
        self.running = bool(tracks)

    def update(self) -> None:
        """Commands the positions of the current time, and ends motions and goals."""
        now = self._host.time_ns
        ended = False
        for track in tuple(self._tracks):
            positions = track.motion.at(now).tolist()
            result = None
            if track.tolerances is not None:
                result = track.verdict(now, positions, self._host.data)
                if result is not None and result.error_code:
                    self.hold(track, result)
                    continue
            for drive, index in track.drives.items():
                drive.command("position", positions[index])
            if result is not None or (track.tolerances is None and now >= track.motion.end):
                track.end(result or Result())
                ended = True
        if ended:
            self._remove_finished()

    def _remove_finished(self) -> None:
        self._ended.extend(track.motion for track in self._tracks if not track.drives)
        self._tracks = [track for track in self._tracks if track.drives]
        self.running = bool(self._tracks)

    def _find_drives(self, trajectory: JointTrajectory) -> list[Drive]:
        names = trajectory.joint_names
        if not names:
            raise RequestError("joint_names is empty")
        drives: dict[Drive, None] = {}
        for index, name in enumerate(names):
            drive = self._joints.find(name)
            if drive in drives:
                raise RequestError(f"joint_names[{index}]: {quoted(name)} is listed twice")
            if "position" not in drive.outputs:
                raise RequestError(
                    f"joint {quoted(name)} accepts {drive.accepted} commands, not position; "
                    f"set pid_gains.position.{name} to allow it"
                )
            drives[drive] = None
        refuse_both_sides(drives)
        return list(drives)

    def _use_desired(self, drives: list[Drive], position: Array, velocity: Array) -> None:
        """Replaces the current positions and velocities by the commanded ones, for joints with a position command."""
        now = self._host.time_ns
        for index, drive in enumerate(drives):
            if drive.desired is not None:
                position[index], velocity[index] = drive.desired, 0.0
        for track in self._tracks:
            positions, velocities = track.motion.at(now), track.motion.velocity_at(now)
            for drive, row in track.drives.items():
                if drive in drives:
                    index = drives.index(drive)
                    position[index], velocity[index] = positions[row], velocities[row]
