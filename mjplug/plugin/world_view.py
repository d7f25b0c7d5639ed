"""The simulated world as a plugin uses it: model, state and simulated time. Physics thread only."""

from collections.abc import Sequence
from pathlib import Path

import mujoco

from mjplug.model.location import locate
from mjplug.physics.simulation import Simulation
from mjplug_schemas.builtin_interfaces import Time


class WorldView:
    """The simulated world as a plugin uses it.

    Attributes:
        model: The compiled model, until `Plugin.on_model_changed` is called.
        data: The current state. References to its arrays stay valid until `Plugin.on_model_changed` is called.
        model_file: The model's file; None if the model was not loaded from a file.

    Args:
        simulation: The model and its state.
        model_file: The model's file.
        folders: Folders in which relative file names of parameters are searched, in this order.
    """

    def __init__(self, simulation: Simulation, model_file: Path | None = None, folders: Sequence[Path] = ()) -> None:
        self.model: mujoco.MjModel = simulation.model
        self.data: mujoco.MjData = simulation.data
        self.model_file = model_file
        self._folders = tuple(folders)
        self._simulation = simulation

    def _use_model(self) -> None:
        """Uses the present model of the simulation from now on."""
        self.model, self.data = self._simulation.model, self._simulation.data

    @property
    def step(self) -> int:
        """Number of steps taken since the server started; restoring a saved state may set it to an earlier number."""
        return self._simulation.step

    @property
    def epoch(self) -> int:
        """Number of resets of the world, and of restored states, since the server started."""
        return self._simulation.epoch

    @property
    def lineage(self) -> int:
        """Number of resets in the past of the present state, for the seeds of noise; a client may give another number.

        Unlike `epoch`, it is restored with a saved state. Noise that depends on it and on the time is then the same.
        """
        return self._simulation.lineage

    @property
    def time_ns(self) -> int:
        """Simulated time [ns]."""
        return self._simulation.time_ns

    @property
    def sensor_time_ns(self) -> int:
        """Simulated time of the state from which `data.sensordata` was computed [ns].

        A step computes the sensors first and integrates last, so after a step they are one step older than `qpos`.
        """
        # If simulated time was set to zero after that step, they are from before.
        return max(0, self._simulation.time.ns(self._simulation.sensor_step))

    def now(self) -> Time:
        """Returns the simulated time as a message, for time stamps."""
        return Time.from_ns(self.time_ns)

    def steps_covering(self, duration_ns: int) -> int:
        """Returns the smallest number of steps whose total length is at least `duration_ns` [ns]."""
        return self._simulation.time.steps_covering(duration_ns)

    def time_of(self, step: int) -> float:
        """Returns the simulated time after `step` steps [s]."""
        return self._simulation.time.seconds(step)

    def body_id(self, name: str) -> int:
        """Returns a body's id.

        Raises:
            UnknownName: The model has no such body; the message lists the bodies.
        """
        return self._simulation.body_id(name)

    def find_file(self, name: str) -> Path:
        """Returns the path of a file that a parameter names.

        Args:
            name: A path relative to the configuration file, an absolute path, or `package://<package>/<path>`.

        Raises:
            ModelError: There is no such file; the message lists the searched locations.
        """
        return locate(name, self._folders)

    def kinematics(self) -> None:
        """Computes `xpos`, `xquat`, `xmat` and `xipos` from the current positions. After a step they are out of date.

        Shapes are (nbody, 3), (nbody, 4), (nbody, 9) and (nbody, 3), in the world frame.
        """
        self._simulation.kinematics()

    def forward(self) -> None:
        """Computes all derived quantities, including sensors, from the current state; costs as much as a step."""
        self._simulation.forward()
