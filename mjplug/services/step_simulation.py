"""`~/step_simulation`: takes an exact number of steps at full speed while the simulation is paused."""

from mjplug.physics.loop import Loop
from mjplug.plugin import Call, Host, RequestError, Slow
from mjplug.services.stepping.ownership import Ownership
from mjplug_schemas.mujoco_ros2_control_msgs import StepSimulation


def offer(host: Host, loop: Loop, ownership: Ownership) -> None:
    """Declares the service. The response is sent after the last step, or when the request is cancelled.

    Args:
        host: The host of the server.
        loop: The physics loop.
        ownership: Which client steps the server; requests of others are refused.
    """

    def step_simulation(request: StepSimulation.Request, call: Call) -> Slow:
        if not loop.paused:
            raise RequestError("the simulation is running; pause it first (~/set_pause, or mjplug sim pause)")
        if request.steps == 0:
            raise RequestError("steps is 0; it must be at least 1")
        ownership.check(ownership.name_in(call.parameters))
        goal = loop.goals.add(host.step, request.steps)
        try:
            yield goal.ended
        finally:
            loop.goals.remove(goal)
        if goal.failure:
            taken = max(0, min(host.step, goal.target) - goal.start)
            raise RequestError(f"{goal.failure} ({taken} of {request.steps} steps were taken)")
        return StepSimulation.Response(
            success=True, message=f"took {request.steps} steps; t = {host.time_ns / 1e9:.6f} s"
        )

    host.create_service(StepSimulation, "~/step_simulation", step_simulation)
