"""Steps per second of the whole server at speed max, against a bare loop of `mj_step(nstep=100)`."""

from time import perf_counter

import mujoco

from benchmarks.measure import Result, pairs
from benchmarks.world import MIDDLING, SMALL, bare_steps_per_second, model_of, server
from mjplug_plugins.external_wrench import ExternalWrench
from mjplug_schemas.builtin_interfaces import Duration
from mjplug_schemas.geometry_msgs import Vector3, Wrench, WrenchStamped
from mjplug_schemas.mujoco_ros2_control_msgs import ApplyExternalWrench, ExternalWrenchArray
from mjplug_schemas.mujoco_ros2_control_msgs import ExternalWrench as ExternalWrenchMsg
from mjplug_schemas.std_msgs import Header

SECONDS = 0.5
"""Wall time of one measurement, about [s]."""


class _Call:
    """A request without a client; the first answer must be a success."""

    def __init__(self, request: ApplyExternalWrench.Request) -> None:
        self.request, self.parameters, self.answered = request, {"wait": "false"}, False

    def respond(self, response: ApplyExternalWrench.Response) -> None:
        assert response.success, response.message
        self.answered = True

    def refuse(self, reason: str) -> None:
        assert self.answered, reason


def _tiny_wrench(body: str) -> _Call:
    """A wrench too weak to change what the model does, for longer than the measurement."""
    message = ExternalWrenchMsg(
        wrench=WrenchStamped(header=Header(frame_id=body), wrench=Wrench(force=Vector3(x=1e-9))),
        duration=Duration(sec=100_000),
    )
    return _Call(ApplyExternalWrench.Request(wrenches=ExternalWrenchArray(external_wrenches=[message])))


def _served_steps_per_second(uri: str, steps: int, wrench: bool) -> float:
    with server(uri) as (served, _):
        if wrench:
            apply = ExternalWrench._apply  # the plugin's own handler, without a client
            plugin = served.plugins["external_wrench"]
            served.loop.serve(_tiny_wrench("base_link"), lambda request, call: apply(plugin, request, call))
        served.loop.last_step = steps
        began = perf_counter()
        served.loop.run()
        elapsed = perf_counter() - began
        assert served.loop.simulation.step == steps
        return steps / elapsed


def results() -> list[Result]:
    """Two models, idle and with one active wrench."""
    found = []
    for uri, word in ((SMALL, "small"), (MIDDLING, "middling")):
        model = model_of(uri)
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
        steps = int(SECONDS * bare_steps_per_second(model, 5000)) // 100 * 100
        cost = 1e6 / bare_steps_per_second(model, steps)
        for wrench, state, goal in ((False, "idle", ">= 0.95"), (True, "one active wrench", ">= 0.6")):
            found.append(
                pairs(
                    f"steps/s, {word} model ({cost:.1f} µs a step), {state}, against bare mj_step(nstep=100)",
                    lambda uri=uri, steps=steps, wrench=wrench: _served_steps_per_second(uri, steps, wrench),
                    lambda model=model, steps=steps: bare_steps_per_second(model, steps),
                    goal,
                    "{:,.0f}/s",
                )
            )
    return found
