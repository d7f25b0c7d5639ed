"""Publishes positions, velocities and efforts of joints."""

from functools import partial
from typing import Annotated, Literal

import mujoco
from pydantic import AfterValidator, Field

from mjplug.plugin import CdrFrame, Host, OneOrMore, Parameters, Plugin
from mjplug_plugins.joints.derived_states import Coordinate, coordinates_of, copying
from mjplug_plugins.joints.scalar_joint import ScalarJoint, chosen, require_unique, scalar_joints
from mjplug_plugins.joints.transmission import Interface, Side, TransmissionParameters, relations_of
from mjplug_schemas.sensor_msgs import JointState
from mjplug_schemas.std_msgs import Header

_JOINT_TRANSMISSIONS = {int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT)}


class JointStatePublisherParameters(Parameters):
    """Parameters of JointStatePublisher."""

    topic: str = Field(default="{ns}/joint_states", description="Topic name.")
    rate: float = Field(default=100.0, gt=0, description="Messages per second of simulated time [Hz].")
    joints: Annotated[tuple[str, ...], OneOrMore, AfterValidator(require_unique)] = Field(
        default=(), description="Joints to publish, in this order; empty: all hinges and slides."
    )
    order: Literal["model", "actuators"] = Field(
        default="model",
        description="Order if `joints` is empty: `model`, or `actuators`: actuated joints first, in actuator order.",
    )
    interfaces: Annotated[tuple[Interface, ...], OneOrMore] = Field(
        default=("position", "velocity", "effort"),
        description="Contents of the messages: any of `position`, `velocity` and `effort`.",
    )
    transmissions: dict[str, TransmissionParameters] = Field(
        default={}, description="Transmissions of ros2_control, by name."
    )
    side: Side = Field(
        default="joints",
        description="Which side of the transmissions the messages contain: `joints` or `actuators`.",
    )
    frame_id: str = Field(default="", description="Frame in the header; joint states need none.")


class JointStatePublisher(Plugin[JointStatePublisherParameters]):
    """Publishes the state of hinges and slides as `sensor_msgs/JointState`.

    Position and velocity are those at the stamp. The effort is the force or torque of the actuators on the joint, gears
    included, during the step that ended at the stamp, because the next effort depends on commands not yet received.
    """

    stateless = True

    def init(self, host: Host, parameters: JointStatePublisherParameters) -> None:
        """Prepares the message and starts the timer."""
        self._host = host
        joints = _joints(host, parameters)
        zeros = [0.0] * len(joints)
        self._message = CdrFrame(
            JointState(
                header=Header(frame_id=host.frame_id(parameters.frame_id)),
                name=[joint.name for joint in joints],
                **dict.fromkeys(parameters.interfaces, zeros),
            )
        )
        sources = {"position": host.data.qpos, "velocity": host.data.qvel, "effort": host.data.qfrc_actuator}
        self._copies = [
            copying(joints, interface, sources[interface], self._message.view(interface))
            for interface in dict.fromkeys(parameters.interfaces)
            if joints
        ]
        self._publisher = host.create_publisher(JointState, parameters.topic, sample=self._sample)
        host.create_timer(1.0 / parameters.rate, self._publish, while_matched=self._publisher)

    def _publish(self) -> None:
        self._publisher.publish_frame(self._sample())

    def _sample(self) -> CdrFrame:
        for copy in self._copies:
            copy()
        self._message.set_stamp("header.stamp", self._host.time_ns)
        return self._message


def _joints(host: Host, parameters: JointStatePublisherParameters) -> list[Coordinate]:
    joints = scalar_joints(host.model)
    relations = relations_of(parameters.transmissions, joints)
    if not parameters.joints:
        return list(coordinates_of(_ordered(host, parameters, joints), relations, parameters.side).values())
    return chosen(coordinates_of(list(joints.values()), relations, parameters.side), parameters.joints, host.model)


def _ordered(
    host: Host, parameters: JointStatePublisherParameters, joints: dict[str, ScalarJoint]
) -> list[ScalarJoint]:
    if not joints:
        host.logger.warning("the model has no hinge or slide with a name: the messages are empty")
    if parameters.order == "actuators":
        actuated = (name for name in map(partial(_driven, host.model), range(host.model.nu)) if name in joints)
        return [joints[name] for name in dict.fromkeys([*actuated, *joints])]
    return list(joints.values())


def _driven(model: mujoco.MjModel, actuator: int) -> str:
    """Returns the name of the joint that an actuator drives, else the actuator's name, which may be a joint's name."""
    if int(model.actuator_trntype[actuator]) in _JOINT_TRANSMISSIONS:
        return mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_JOINT, int(model.actuator_trnid[actuator, 0])) or ""
    return mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_ACTUATOR, actuator) or ""
