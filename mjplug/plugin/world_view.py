"""What a plugin sees of the world: the model, its state and simulated time. Physics thread only."""

from collections.abc import Sequence
from pathlib import Path

import mujoco

from mjplug.model.location import locate
from mjplug.physics.simulation import Simulation
from mjplug_schemas.builtin_interfaces import Time


class WorldView:
    """The world as a plugin sees it.

    Attributes:
        model: The compiled model. Fixed for the life of the plugin.
        data: The live state. What `init` caches of its arrays stays valid.
        model_file: The model's file; None if it comes from none.

    Args:
        simulation: The model and its state.
        model_file: The model's file.
        folders: Where relative file names in the instance's parameters count from, first choice first.
    """

    def __init__(self, simulation: Simulation, model_file: Path | None = None, folders: Sequence[Path] = ()) -> None:
        self.model: mujoco.MjModel = simulation.model
        self.data: mujoco.MjData = simulation.data
        self.model_file = model_file
        self._folders = tuple(folders)
        self._simulation = simulation

    @property
    def step(self) -> int:
        """Steps taken since the server started."""
        return self._simulation.step

    @property
    def epoch(self) -> int:
        """Resets of the world since the server started."""
        return self._simulation.epoch

    @property
    def time_ns(self) -> int:
        """Simulated time [ns]."""
        return self._simulation.time_ns

    @property
    def sensor_time_ns(self) -> int:
        """Simulated time of the state that `data.sensordata` belongs to [ns].

        A step computes the sensors first and integrates last, so after it they are one step older than `qpos`.
        """
        return self._simulation.time.ns(self._simulation.sensor_step)

    def now(self) -> Time:
        """Returns the simulated time as a message, for stamps."""
        return Time.from_ns(self.time_ns)

    def steps_covering(self, duration_ns: int) -> int:
        """Returns the smallest number of steps that together last at least `duration_ns` [ns]."""
        return self._simulation.time.steps_covering(duration_ns)

    def time_of(self, step: int) -> float:
        """Returns the simulated time of a step boundary [s]."""
        return self._simulation.time.seconds(step)

    def body_id(self, name: str) -> int:
        """Returns a body's id.

        Raises:
            UnknownName: The model has no such body; the sentence lists those it has.
        """
        return self._simulation.body_id(name)

    def find_file(self, name: str) -> Path:
        """Returns the file that a parameter names: relative to the configuration file, absolute, or package://pkg/path.

        Raises:
            ModelError: There is none; the sentence says where it was looked for.
        """
        return locate(name, self._folders)

    def kinematics(self) -> None:
        """Makes `xpos`, `xquat`, `xmat` and `xipos` those of the current positions; a step leaves them older."""
        self._simulation.kinematics()

    def forward(self) -> None:
        """Makes everything derived, sensors too, that of the current state; costs about a step."""
        self._simulation.forward()
