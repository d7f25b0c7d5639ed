"""The trajectories that are under way, and which joint each of them moves."""

import numpy as np
from numpy.typing import NDArray

from mjplug.plugin import Host, RequestError
from mjplug.plugin.bundled import quoted
from mjplug_plugins.joints.drives import JointDrives
from mjplug_plugins.joints.route import Drive
from mjplug_plugins.joints.trajectory import Motion, check
from mjplug_schemas.trajectory_msgs import JointTrajectory

Array = NDArray[np.float64]


class _Track:
    """A motion and the joints that it still moves."""

    def __init__(self, motion: Motion, drives: list[Drive]) -> None:
        self.motion = motion
        self.drives: dict[Drive, int] = {drive: index for index, drive in enumerate(drives)}


class Trajectories:
    """Starts, replaces and plays trajectories. A joint is in one of them at most.

    Attributes:
        running: Whether any joint is under way.

    Args:
        host: For the time and the state.
        joints: What can be commanded.
        from_desired: Whether a motion starts where the joint was told to be, instead of where it is.
    """

    def __init__(self, host: Host, joints: JointDrives, from_desired: bool) -> None:
        self._host, self._joints, self._from_desired = host, joints, from_desired
        self._tracks: list[_Track] = []
        self.running = False

    @property
    def count(self) -> int:
        """Joints that are under way."""
        return sum(len(track.drives) for track in self._tracks)

    def start(self, trajectory: JointTrajectory) -> None:
        """Lets joints follow a trajectory; one without points stops them where they are.

        Raises:
            RequestError: Something in it is wrong; the joints go on as before.
        """
        drives = self._drives(trajectory)
        if not trajectory.points:
            for drive in drives:
                self.drop(drive)
                drive.command("position", float(self._host.data.qpos[drive.joint.qpos]))
            return
        now = self._host.time_ns
        check(trajectory, now)
        position = np.array([self._host.data.qpos[drive.joint.qpos] for drive in drives])
        velocity = np.array([self._host.data.qvel[drive.joint.dof] for drive in drives])
        if self._from_desired:
            self._take_desired(drives, position, velocity)
        motion = Motion(trajectory, now, position, velocity)
        for drive in drives:
            self.drop(drive)
        self._tracks.append(_Track(motion, drives))
        self.running = True

    def drop(self, drive: Drive) -> None:
        """Takes a joint out of its trajectory."""
        if self.running:
            for track in self._tracks:
                track.drives.pop(drive, None)
            self._sweep()

    def clear(self) -> None:
        """Ends all of them."""
        self._tracks.clear()
        self.running = False

    def update(self) -> None:
        """Tells each joint where to be at this moment."""
        now = self._host.time_ns
        ended = False
        for track in self._tracks:
            positions = track.motion.at(now).tolist()
            for drive, index in track.drives.items():
                drive.command("position", positions[index])
            if now >= track.motion.end:
                track.drives.clear()
                ended = True
        if ended:
            self._sweep()

    def _sweep(self) -> None:
        self._tracks = [track for track in self._tracks if track.drives]
        self.running = bool(self._tracks)

    def _drives(self, trajectory: JointTrajectory) -> list[Drive]:
        names = trajectory.joint_names
        if not names:
            raise RequestError("joint_names is empty")
        drives: dict[Drive, None] = {}
        for index, name in enumerate(names):
            drive = self._joints.find(name)
            if drive in drives:
                raise RequestError(f"joint_names[{index}]: {quoted(name)} comes twice")
            if "position" not in drive.routes:
                raise RequestError(
                    f"joint {quoted(name)} takes {' and '.join(drive.routes) or 'nothing'}, no positions; "
                    f"pid_gains.position.{name} would let it"
                )
            drives[drive] = None
        return list(drives)

    def _take_desired(self, drives: list[Drive], position: Array, velocity: Array) -> None:
        """Puts what joints were told in the place of what they do, where they were told a position."""
        now = self._host.time_ns
        for index, drive in enumerate(drives):
            if drive.desired is not None:
                position[index], velocity[index] = drive.desired, 0.0
        for track in self._tracks:
            told, speeds = track.motion.at(now), track.motion.velocity_at(now)
            for drive, row in track.drives.items():
                if drive in drives:
                    index = drives.index(drive)
                    position[index], velocity[index] = told[row], speeds[row]
