"""Publishes positions, velocities and efforts of joints."""

from collections.abc import Callable
from functools import partial
from itertools import pairwise
from typing import Annotated, Any, Literal

import mujoco
import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, Field

from mjplug.plugin import CdrFrame, Host, Parameters, Plugin
from mjplug_plugins.joints.scalar_joint import ScalarJoint, chosen, each_once, scalar_joints
from mjplug_schemas.sensor_msgs import JointState
from mjplug_schemas.std_msgs import Header

Interface = Literal["position", "velocity", "effort"]

_JOINT_TRANSMISSIONS = {int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT)}


class JointStatePublisherParameters(Parameters):
    """Parameters of JointStatePublisher."""

    topic: str = Field(default="{ns}/joint_states", description="Topic name.")
    rate: float = Field(default=100.0, gt=0, description="Messages per second of simulated time [Hz].")
    joints: Annotated[tuple[str, ...], AfterValidator(each_once)] = Field(
        default=(), strict=False, description="Joints to publish, in this order; empty means all hinges and slides."
    )
    order: Literal["model", "actuators"] = Field(
        default="model",
        description="Order without `joints`: `model`, or `actuators`: those with an actuator first, in their order.",
    )
    interfaces: tuple[Interface, ...] = Field(
        default=("position", "velocity", "effort"),
        strict=False,
        description="What the messages have of each joint: any of `position`, `velocity` and `effort`.",
    )
    frame_id: str = Field(default="", description="The frame in the header; joints need none.")


class JointStatePublisher(Plugin[JointStatePublisherParameters]):
    """Publishes the state of hinges and slides as `sensor_msgs/JointState`.

    Position and velocity are those of the stamp. The effort is what the actuators exerted on the joint, gears included,
    in the step that ended at the stamp: what they will exert next is not known before the next commands are.
    """

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
        sources = {
            "position": (host.data.qpos, [joint.qpos for joint in joints]),
            "velocity": (host.data.qvel, [joint.dof for joint in joints]),
            "effort": (host.data.qfrc_actuator, [joint.dof for joint in joints]),
        }
        self._copies = [
            _copy(*sources[interface], self._message.view(interface))
            for interface in dict.fromkeys(parameters.interfaces)
            if joints
        ]
        self._publisher = host.create_publisher(JointState, parameters.topic)
        host.create_timer(1.0 / parameters.rate, self._publish, while_matched=self._publisher)

    def _publish(self) -> None:
        for copy in self._copies:
            copy()
        self._message.set_stamp("header.stamp", self._host.time_ns)
        self._publisher.publish_frame(self._message)


def _copy(source: NDArray[np.float64], places: list[int], target: NDArray[Any]) -> Callable[[], object]:
    """Returns what copies some elements of an array; in one piece if they follow each other, as a robot's joints do."""
    if all(b == a + 1 for a, b in pairwise(places)):
        there, here = source.data.cast("B").cast("d")[places[0] : places[-1] + 1], target.data.cast("B").cast("d")
        return partial(here.__setitem__, slice(None), there)
    return partial(source.take, np.array(places, np.intp), out=target, mode="clip")


def _joints(host: Host, parameters: JointStatePublisherParameters) -> list[ScalarJoint]:
    joints = scalar_joints(host.model)
    if parameters.joints:
        return chosen(joints, parameters.joints, host.model)
    if not joints:
        host.logger.warning("the model has no named hinge or slide: the messages are empty")
    if parameters.order == "actuators":
        actuated = (name for name in map(partial(_driven, host.model), range(host.model.nu)) if name in joints)
        return [joints[name] for name in dict.fromkeys([*actuated, *joints])]
    return list(joints.values())


def _driven(model: mujoco.MjModel, actuator: int) -> str:
    """Returns the joint that an actuator drives; of a tendon or site, the actuator's own name is that of a joint."""
    if int(model.actuator_trntype[actuator]) in _JOINT_TRANSMISSIONS:
        return mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_JOINT, int(model.actuator_trnid[actuator, 0])) or ""
    return mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_ACTUATOR, actuator) or ""
