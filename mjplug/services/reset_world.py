"""`~/reset_world`: resets the world to the initial state or a keyframe, with overrides."""

from dataclasses import replace

from mjplug.errors import RequestError
from mjplug.physics.loop import Loop
from mjplug.plugin import Call, Host
from mjplug.services.episode import episode_in
from mjplug.services.reset_request import validate
from mjplug_schemas.mujoco_ros2_control_msgs import ResetWorld


def offer(host: Host, loop: Loop) -> None:
    """Declares the service.

    An invalid request changes nothing. A reset does not change whether the simulation is paused. Simulated time
    continues, except with the selector's parameter `episode`.
    """

    def reset_world(request: ResetWorld.Request, call: Call) -> ResetWorld.Response:
        try:
            episode = episode_in(call.parameters)
            plan = replace(validate(loop.simulation, request.keyframe, request.state_overrides), episode=episode)
        except RequestError as error:
            raise RequestError(f"{error}; the world was not reset") from None
        loop.reset(plan)
        state = f"keyframe {request.keyframe!r}" if request.keyframe else "its initial state"
        counts = ((len(plan.joints), "joint"), (len(plan.free_joints), "free body"))
        overrides = [f"{n} {what} override{'s' if n > 1 else ''}" for n, what in counts if n]
        message = f"the world was reset to {state}" + (f" with {' and '.join(overrides)}" if overrides else "")
        return ResetWorld.Response(success=True, message=message)

    host.create_service(ResetWorld, "~/reset_world", reset_world)
