"""Steps per second of a complete server at maximum speed, compared with a loop of `mj_step(nstep=100)`."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from time import perf_counter

from benchmarks.measure import Result, pairs
from benchmarks.world import MIDDLING, PLUGINS, SMALL, BareLoop, every_plugin, server
from mjplug.physics import process
from mjplug.plugin.selection import Selected
from mjplug.server.server import Server
from mjplug_schemas.builtin_interfaces import Duration
from mjplug_schemas.geometry_msgs import Twist, Vector3, Wrench, WrenchStamped
from mjplug_schemas.mujoco_ros2_control_msgs import ApplyExternalWrench, ExternalWrenchArray
from mjplug_schemas.mujoco_ros2_control_msgs import ExternalWrench as ExternalWrenchMsg
from mjplug_schemas.std_msgs import Header

BASE = "base_link"
"""The body of both models that has the free joint."""

SECONDS, REPEATS = 0.1, 31
"""Approximate wall time of one measurement [s], short so that both of a pair run at the same speed; number of pairs."""


class _Call:
    """A request without a client; the first response must be a success."""

    def __init__(self, request: ApplyExternalWrench.Request) -> None:
        self.request, self.parameters, self.answered = request, {"wait": "false"}, False

    def respond(self, response: ApplyExternalWrench.Response) -> None:
        assert response.success, response.message
        self.answered = True

    def refuse(self, reason: str) -> None:
        assert self.answered, reason


def _tiny_wrench(body: str) -> _Call:
    """Returns a wrench that is too weak to affect the model and lasts longer than the measurement."""
    message = ExternalWrenchMsg(
        wrench=WrenchStamped(header=Header(frame_id=body), wrench=Wrench(force=Vector3(x=1e-9))),
        duration=Duration(sec=100_000),
    )
    return _Call(ApplyExternalWrench.Request(wrenches=ExternalWrenchArray(external_wrenches=[message])))


@contextmanager
def _served(
    uri: str, steps: int, plugins: Sequence[Selected], prepare: Callable[[Server], None]
) -> Iterator[Callable[[], float]]:
    """Yields a function that runs `steps` steps with a complete server and returns the steps per second."""
    with server(uri, plugins=plugins) as (served, _):
        prepare(served)
        loop = served.loop

        def measure() -> float:
            loop.last_step = loop.simulation.step + steps
            began = perf_counter()
            loop.run()
            elapsed = perf_counter() - began
            assert loop.simulation.step == loop.last_step
            return steps / elapsed

        with process.frozen_garbage(), process.fast_thread_switching():
            yield measure


def _nothing(served: Server) -> None:
    pass


def _push(served: Server) -> None:
    # Calls the plugin's handler without a client.
    served.loop.serve(_tiny_wrench(BASE), served.plugins["external_wrench"]._apply)


def _drive(served: Server) -> None:
    """Drives the base so slowly that the motion of the model does not change."""
    served.plugins["base_velocity"]._handle(Twist(linear=Vector3(x=1e-6), angular=Vector3(z=1e-6)))


def results() -> list[Result]:
    """Measures two models: idle, with one active wrench, with all plugins, and with a driven base."""
    every = every_plugin(BASE)
    rows = []
    for uri, word, active_goal in ((SMALL, "small", ">= 0.75"), (MIDDLING, "medium", ">= 0.85")):
        cases = [
            (PLUGINS, _nothing, "idle", ">= 0.95"),
            (PLUGINS, _push, "one active wrench", active_goal),
            (every, _nothing, f"all {len(every)} plugins, without subscribers", ">= 0.9"),
            (every, _drive, f"all {len(every)} plugins, a driven base", active_goal),
        ]
        bare = BareLoop(uri)
        steps = int(SECONDS * bare.steps_per_second(5000)) // 100 * 100
        for plugins, prepare, state, goal in cases:
            with _served(uri, steps, plugins, prepare) as ours:
                result = pairs(
                    f"steps/s, {word} model, {state}, against mj_step(nstep=100)",
                    ours,
                    lambda bare=bare, steps=steps: bare.steps_per_second(steps),
                    goal,
                    "{:,.0f}/s",
                    REPEATS,
                )
            rows.append(result)
    return rows
