"""Adding entities while physics runs: how long steps and clients wait, and what lists of states cost."""

import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from time import perf_counter, sleep, thread_time
from typing import Any

import mujoco
import numpy as np

import mjplug
from benchmarks.measure import Result, pairs
from benchmarks.meshed_robot import BODIES, meshed_robot
from mjplug.client import Client
from mjplug.physics.simulation import Simulation
from mjplug.services.standard.entities import Entities
from mjplug.services.standard.entity_states import rows_of

_CUP = "<mujoco><worldbody><body name='cup'><freejoint/><geom size='.05' mass='.1'/></body></worldbody></mujoco>"
_REPEATS = 5


def results() -> list[Result]:
    """Measures a server in this process that runs in real time, to which a small and a meshed model are added."""
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "cup.xml").write_text(_CUP, encoding="utf-8")
        (Path(folder) / "robot.xml").write_text(meshed_robot(), encoding="utf-8")
        with _Server.opened(folder) as server:
            return [
                server.gap("a small body", "cup.xml"),
                server.gap(f"a robot of {BODIES} bodies with meshes", "robot.xml"),
                server.latency("a small body", "cup.xml"),
                server.latency(f"a robot of {BODIES} bodies with meshes", "robot.xml"),
                server.swap("robot.xml"),
                _states(),
            ]


class _Server:
    """A running server whose steps are timed."""

    def __init__(self, server: mjplug.RunningServer, client: Client) -> None:
        self._client = client
        self._loop = server._opened.server.loop
        self._longest, self._last, self._swaps = 0.0, perf_counter(), [0.0]
        advance, change = self._loop.simulation.advance, self._loop.change_model

        def timed_advance(steps: int) -> Any:
            now = perf_counter()
            self._longest, self._last = max(self._longest, now - self._last), now
            return advance(steps)

        def timed_change(replacement: Any) -> None:
            began = perf_counter()
            change(replacement)
            self._swaps.append(perf_counter() - began)

        vars(self._loop.simulation)["advance"] = timed_advance
        vars(self._loop)["change_model"] = timed_change

    @staticmethod
    @contextmanager
    def opened(folder: str) -> "Iterator[_Server]":
        settings = {"simulation_interfaces.spawnables": [folder]}
        with mjplug.open_server("bundled:quadruped", settings=settings) as server, server.client() as client:
            yield _Server(server, client)

    def gap(self, what: str, uri: str) -> Result:
        """Compares the longest time between two steps while something is added with that of the same time without."""
        took = [0.1]

        def spawning() -> float:
            took[0] = self._during(lambda: self._spawn(uri))[1]
            longest = self._longest
            self._delete()
            return 1e3 * longest

        def idle() -> float:
            end = perf_counter() + took[0]
            self._during(lambda: self._wait_until(end))
            return 1e3 * self._longest

        return pairs(f"longest time between two steps while {what} is added", spawning, idle, "<= 2", "{:.1f} ms")

    def latency(self, what: str, uri: str) -> Result:
        """Compares the time of a request with that of compiling the model alone."""

        def spawning() -> float:
            took = self._during(lambda: self._spawn(uri))[1]
            self._delete()
            return 1e3 * took

        path = next(
            item.entity_resource.uri for item in self._call("get_spawnables").spawnables
            if item.entity_resource.uri.endswith(uri)
        )  # fmt: skip

        def compiling() -> float:
            began = perf_counter()
            mujoco.MjSpec.from_file(path.removeprefix("file://")).compile()
            return 1e3 * (perf_counter() - began)

        return pairs(f"adding {what}, against compiling it alone", spawning, compiling, "<= 3", "{:.1f} ms", _REPEATS)

    def swap(self, uri: str) -> Result:
        """Compares the time for which a change interrupts physics with mj_forward of the changed model."""

        def swapping() -> float:
            self._spawn(uri)
            took = self._swaps[-1]
            self._delete()
            return 1e3 * took

        model = mujoco.MjModel.from_xml_string(meshed_robot())
        data = mujoco.MjData(model)

        def forward() -> float:
            began = perf_counter()
            mujoco.mj_forward(model, data)
            return 1e3 * (perf_counter() - began)

        what = "interruption by a change of the model, against mj_forward"
        return pairs(what, swapping, forward, "<= 10", "{:.2f} ms")

    def _during(self, act: Callable[[], None]) -> tuple[None, float]:
        self._longest, self._last = 0.0, perf_counter()
        began = perf_counter()
        act()
        return None, perf_counter() - began

    def _spawn(self, uri: str) -> None:
        pose = {"pose": {"position": {"x": 5.0, "z": 2.0}, "orientation": {"w": 1.0}}}
        self._call("spawn_entity", {"name": "x", "entity_resource": {"uri": uri}, "initial_pose": pose})

    def _delete(self) -> None:
        self._call("delete_entity", {"entity": "x"})

    def _call(self, name: str, request: dict[str, Any] | None = None) -> Any:
        response = self._client.call(f"/{name}", request or {}, timeout=120.0)
        assert response.result.result == 1, response.result.error_message
        return response

    @staticmethod
    def _wait_until(end: float) -> None:
        while perf_counter() < end:
            # As a client that waits for a response, it leaves the processor to physics.
            sleep(0.001)


def _states() -> Result:
    """Compares the time for reading the states of 100 bodies with one step of them."""
    bodies = "".join(f"<body pos='{i} 0 1'><freejoint/><geom size='.1'/></body>" for i in range(100))
    simulation = Simulation(mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{bodies}</worldbody></mujoco>"))
    entities = list(Entities(simulation, {}).all().values())

    def reading() -> float:
        return _median(lambda: rows_of(simulation, entities))

    def stepping() -> float:
        return _median(lambda: simulation.advance(1))

    what = "reading the states of 100 free bodies (GetEntitiesStates), against a step"
    return pairs(what, reading, stepping, "<= 20", "{:.3f} ms")


def _median(act: Callable[[], object]) -> float:
    times = []
    for _ in range(50):
        began = thread_time()
        act()
        times.append(thread_time() - began)
    return 1e3 * float(np.median(times))
