"""A plugin of one's own: wind that presses against a body."""

import numpy as np
from pydantic import Field

from mjplug.plugin import LATCHED, Host, Parameters, Plugin
from mjplug_schemas.geometry_msgs import Vector3

AIR = 1.2
"""Density of air [kg/m^3]."""


class WindParameters(Parameters):
    """Parameters of Wind."""

    body: str = Field(description="Body that the wind meets.")
    area: float = Field(default=0.1, gt=0, description="Area that the wind meets [m^2].")
    drag: float = Field(default=1.2, gt=0, description="Drag coefficient; a plate has 1.2.")


class Wind(Plugin[WindParameters]):
    """Pushes a body as the wind would; `~/velocity` says how it blows, `~/force` how hard it pushes (Vector3)."""

    def init(self, host: Host, parameters: WindParameters) -> None:
        """Looks the body up, and listens for the weather."""
        self.host = host
        self.body = host.body_id(parameters.body)
        self.factor = 0.5 * AIR * parameters.drag * parameters.area
        self.force = np.zeros(3)
        self.forces = host.create_publisher(Vector3, "~/force", LATCHED)
        host.create_subscription(Vector3, "~/velocity", self.blow)

    def blow(self, velocity: Vector3) -> None:
        """Takes a new velocity [m/s], in the axes of the world."""
        wind = np.array([velocity.x, velocity.y, velocity.z])
        self.force = self.factor * np.linalg.norm(wind) * wind
        x, y, z = self.force.tolist()
        self.forces.publish(Vector3(x=x, y=y, z=z))
        # `update` is called while there is wind, and costs nothing in a calm.
        (self.host.activate if wind.any() else self.host.deactivate)()

    def update(self) -> None:
        """Pushes at the centre of mass, before each step."""
        self.host.data.xfrc_applied[self.body, :3] += self.force

    def on_reset(self) -> None:
        """A new world begins in a calm."""
        self.force[:] = 0.0
        self.host.deactivate()
