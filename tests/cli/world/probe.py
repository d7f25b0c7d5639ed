"""Tells the state of the simulation on request, so that a test outside can compare it."""

import json

from mjplug.plugin import Host, Parameters, Plugin
from mjplug_schemas.geometry_msgs import Twist
from mjplug_schemas.std_srvs import Trigger


class Probe(Plugin[Parameters]):
    """Service `~/state`: the state as JSON. Topic `~/twist`: read and counted."""

    def init(self, host: Host, parameters: Parameters) -> None:
        self.host = host
        # A long run must not fill memory.
        self.twists, self.last_x = 0, 0.0
        host.create_service(Trigger, "~/state", self.tell)
        host.create_subscription(Twist, "~/twist", self.count)

    def count(self, twist: Twist) -> None:
        self.twists, self.last_x = self.twists + 1, twist.linear.x

    def tell(self, request, call):
        data = self.host.data
        state = {
            "step": self.host.step,
            "time_ns": self.host.time_ns,
            "epoch": self.host.epoch,
            "qpos": data.qpos.tolist(),
            "qvel": data.qvel.tolist(),
            "xfrc": data.xfrc_applied.tolist(),
            "twists": self.twists,
            "last_twist_x": self.last_x,
        }
        return Trigger.Response(success=True, message=json.dumps(state))
