"""`~/set_pause`: stops and continues simulated time."""

from mjplug.physics.loop import Loop
from mjplug.plugin import Call, Host
from mjplug_schemas.mujoco_ros2_control_msgs import SetPause


def offer(host: Host, loop: Loop) -> None:
    """Declares the service; its answer comes when no further step will be (or the first may be) taken."""

    def set_pause(request: SetPause.Request, call: Call) -> SetPause.Response:
        state = "paused" if request.paused else "running"
        if request.paused and loop.goals:
            loop.goals.give_up("interrupted: the simulation was paused")
            return SetPause.Response(
                success=True, message="the simulation is paused; the steps under way were given up"
            )
        if request.paused == loop.paused:
            return SetPause.Response(success=True, message=f"the simulation is already {state}")
        if request.paused:
            loop.pause()
        else:
            loop.resume()
        return SetPause.Response(success=True, message=f"the simulation is now {state}")

    host.create_service(SetPause, "~/set_pause", set_pause)
