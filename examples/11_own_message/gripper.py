"""A plugin with its own message type and service type: the gripper of bundled:arm."""

from gripper_msgs import GripperState, MoveGripper
from pydantic import Field

from mjplug.plugin import Call, Host, Parameters, Plugin, RequestError, Slow

STROKE = 0.045
"""Travel of each finger from open to closed [m]."""


class GripperParameters(Parameters):
    """Parameters of Gripper."""

    rate: float = Field(default=20.0, gt=0, description="Messages per second of simulated time [Hz].")
    duration: float = Field(default=1.0, gt=0, description="Duration of a motion, in simulated time [s].")


class Gripper(Plugin[GripperParameters]):
    """Publishes `~/state` (GripperState) and provides the service `~/move` (MoveGripper)."""

    def init(self, host: Host, parameters: GripperParameters) -> None:
        """Finds the actuator and a finger, and creates the publisher, the timer and the service."""
        self.host, self.duration = host, parameters.duration
        self.actuator = host.model.actuator("gripper_left_finger_joint").id
        self.finger = int(host.model.joint("gripper_left_finger_joint").qposadr[0])
        self.states = host.create_publisher(GripperState, "~/state")
        host.create_timer(1.0 / parameters.rate, self.publish, while_matched=self.states)
        host.create_service(MoveGripper, "~/move", self.move)

    def publish(self) -> None:
        """Publishes the present state."""
        self.states.publish(self.state())

    def state(self) -> GripperState:
        """Returns the present state."""
        opening = 2.0 * (STROKE + float(self.host.data.qpos[self.finger]))
        kind = GripperState.BETWEEN
        if opening < 0.002:
            kind = GripperState.CLOSED
        elif opening > 2.0 * STROKE - 0.002:
            kind = GripperState.OPEN
        header = GripperState().header.model_copy(update={"stamp": self.host.now()})
        return GripperState(header=header, state=kind, opening=opening)

    def move(self, request: MoveGripper.Request, call: Call) -> Slow:
        """Sets the target of the actuator, waits in simulated time, and answers with the state."""
        if not 0.0 <= request.opening <= 2.0 * STROKE:
            raise RequestError(f"opening is {request.opening:g} m; it must be from 0 to {2.0 * STROKE:g} m")
        self.host.data.ctrl[self.actuator] = request.opening / 2.0 - STROKE
        yield self.host.step + self.host.steps_covering(round(self.duration * 1e9))
        return MoveGripper.Response(success=True, reached=self.state())
