"""`~/set_pause`: pauses and resumes the simulation."""

from mjplug.physics.loop import Loop
from mjplug.plugin import Call, Host
from mjplug_schemas.mujoco_ros2_control_msgs import SetPause


def offer(host: Host, loop: Loop) -> None:
    """Declares the service.

    The response is sent when the change is in effect. Pausing or resuming cancels a running `step_simulation`.
    """

    def set_pause(request: SetPause.Request, call: Call) -> SetPause.Response:
        state = "paused" if request.paused else "running"
        if request.paused and loop.goals:
            loop.goals.cancel("interrupted: the simulation was paused")
            return SetPause.Response(
                success=True, message="the simulation is paused; the running step_simulation was cancelled"
            )
        if request.paused == loop.paused:
            return SetPause.Response(success=True, message=f"the simulation is already {state}")
        if request.paused:
            loop.pause()
        else:
            loop.resume()
        return SetPause.Response(success=True, message=f"the simulation is now {state}")

    host.create_service(SetPause, "~/set_pause", set_pause)
