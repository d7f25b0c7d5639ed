"""Publishes a line of text at a fixed rate of simulated time: the simplest plugin, and a check that the server runs."""

from collections.abc import Mapping
from typing import Any

from pydantic import Field

from mjplug.plugin import Host, Parameters, Plugin
from mjplug_schemas.std_msgs import String


class HeartbeatParameters(Parameters):
    """Parameters of Heartbeat."""

    update_rate: float = Field(default=1.0, gt=0, description="Messages per second of simulated time [Hz].")
    topic: str = Field(default="{ns}/mujoco_heartbeat", description="Topic name.")


class Heartbeat(Plugin[HeartbeatParameters]):
    """Publishes `std_msgs/String` with a counter and the simulated time."""

    def init(self, host: Host, parameters: HeartbeatParameters) -> None:
        """Starts the timer."""
        self._host = host
        self._count = 0
        self._publisher = host.create_publisher(String, parameters.topic)
        host.create_timer(1.0 / parameters.update_rate, self._beat)

    def save(self) -> dict[str, int]:
        """Returns the counter."""
        return {"count": self._count}

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Sets the counter."""
        self._count = int(saved["count"])

    def _beat(self) -> None:
        if self._publisher.matched:
            seconds = self._host.time_ns / 1e9
            text = f"MuJoCo ROS2 Control Heartbeat #{self._count} | Simulation time: {seconds:.6f}s"
            self._publisher.publish(String(data=text))
        self._count += 1
