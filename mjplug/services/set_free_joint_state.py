"""`~/set_free_joint_state`: sets poses and velocities of free bodies."""

from mjplug.physics import free_joint
from mjplug.physics.loop import Loop
from mjplug.plugin import Call, Host
from mjplug.services.free_joint_request import validate
from mjplug_schemas.mujoco_ros2_control_msgs import SetFreeJointState


def offer(host: Host, loop: Loop) -> None:
    """Declares the service.

    An invalid request changes nothing. All derived quantities are up to date before the response is sent.
    """

    def set_free_joint_state(request: SetFreeJointState.Request, call: Call) -> SetFreeJointState.Response:
        targets = validate(loop.simulation, request.free_joints)
        if targets:
            free_joint.apply(loop.simulation, targets)
            loop.simulation.forward()
        bodies = "1 body" if len(targets) == 1 else f"{len(targets)} bodies"
        return SetFreeJointState.Response(success=True, message=f"set the state of {bodies}")

    host.create_service(SetFreeJointState, "~/set_free_joint_state", set_free_joint_state)
