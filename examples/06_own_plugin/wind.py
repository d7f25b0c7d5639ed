"""An example of a plugin: wind that pushes a body."""

import numpy as np
from pydantic import Field

from mjplug.plugin import LATCHED, Host, Parameters, Plugin
from mjplug_schemas.geometry_msgs import Vector3

AIR = 1.2
"""Density of air [kg/m^3]."""


class WindParameters(Parameters):
    """Parameters of Wind."""

    body: str = Field(description="Body that the wind pushes.")
    area: float = Field(default=0.1, gt=0, description="Area of the body in the wind [m^2].")
    drag: float = Field(default=1.2, gt=0, description="Drag coefficient; a plate has 1.2.")


class Wind(Plugin[WindParameters]):
    """Applies the drag of the wind to a body.

    Subscribes to `~/velocity`, the velocity of the wind [m/s], and publishes `~/force` [N]. Both are Vector3 in the
    world frame.
    """

    def init(self, host: Host, parameters: WindParameters) -> None:
        """Finds the body and creates the publisher and the subscription."""
        self.host = host
        self.body = host.body_id(parameters.body)
        self.factor = 0.5 * AIR * parameters.drag * parameters.area
        self.force = np.zeros(3)
        self.forces = host.create_publisher(Vector3, "~/force", LATCHED)
        host.create_subscription(Vector3, "~/velocity", self.blow)

    def blow(self, velocity: Vector3) -> None:
        """Computes the force of a new wind velocity [m/s], in the world frame."""
        wind = np.array([velocity.x, velocity.y, velocity.z])
        self.force = self.factor * np.linalg.norm(wind) * wind
        x, y, z = self.force.tolist()
        self.forces.publish(Vector3(x=x, y=y, z=z))
        # With no wind, `update` is not called.
        (self.host.activate if wind.any() else self.host.deactivate)()

    def update(self) -> None:
        """Applies the force at the centre of mass, before each step."""
        self.host.data.xfrc_applied[self.body, :3] += self.force

    def on_reset(self) -> None:
        """Sets the wind to zero."""
        self.force[:] = 0.0
        self.host.deactivate()
