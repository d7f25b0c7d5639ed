"""Control steps: one request each or in chunks, over Zenoh and in process, against a bare query and bare physics."""

from collections.abc import Callable
from pathlib import Path
from time import perf_counter

import gymnasium
import mujoco
import numpy as np

import mjplug.gym
from benchmarks.measure import Result, figure, pairs
from benchmarks.round_trip import BARE, round_trip, serving_process
from benchmarks.world import client
from mjplug import open_server
from mjplug.client import connect
from mjplug.wire.endpoints import with_free_port
from mjplug_schemas.builtin_interfaces import Time
from mjplug_schemas.mjplug_msgs import Step

CHUNK = 50
_STEPS = 2000
_ROOT = Path(__file__).parent.parent
_MODELS = {
    "a cart with a pole": _ROOT / "examples" / "09_lockstep" / "cart_pole.xml",
    "the bundled arm": _ROOT / "mjplug" / "bundled" / "arm.xml",
}


def results() -> list[Result]:
    """Measures each way to take control steps."""
    rows = [_round_trips()]
    for name, file in _MODELS.items():
        rows += _chunks(name, file)
    rows += _local(*next(iter(_MODELS.items())))
    rows += _states()
    rows.append(_gym())
    return rows


def _round_trips() -> Result:
    """The round trip of one request with one step, against a bare query with payloads of the same size."""
    file = str(_MODELS["a cart with a pole"])
    request = Step.Request(ctrl=[0.1], observe=["qpos", "qvel"]).to_cdr()
    answer = Step.Response(
        success=True, step=1, stamp=Time(nanosec=2_000_000), observations=[0.1] * 4, widths=[2, 2]
    ).to_cdr()
    free = "tcp/127.0.0.1:0"
    with (
        serving_process("-c", BARE, with_free_port(free), answer.hex()) as bare_at,
        serving_process("-m", "mjplug", "serve", file, "--paused", "--listen", free) as served_at,
        client(bare_at) as bare,
        client(served_at) as session,
    ):
        return pairs(
            "round trip of ~/step with one step of a cart with a pole, against a bare Zenoh query",
            lambda: round_trip(session, "mjplug/step", request),
            lambda: round_trip(bare, "bare", request),
            "<= 1.35",
            "{:.0f} µs",
        )


def _chunks(name: str, file: Path) -> list[Result]:
    """One step of a chunk over Zenoh, against the same loop in one process without mjplug."""
    model = mujoco.MjModel.from_xml_path(str(file))
    controls = np.random.default_rng(0).uniform(-0.1, 0.1, (CHUNK, model.nu))
    bare = _bare_loop(model, controls)
    free = "tcp/127.0.0.1:0"
    with (
        serving_process("-m", "mjplug", "serve", str(file), "--paused", "--listen", free) as endpoint,
        connect(endpoint) as far,
    ):
        row = pairs(
            f"one of {CHUNK} steps in one request, {name}, against a Python loop of mj_step that copies qpos and qvel",
            lambda: _time(lambda: far.rollout(controls), _STEPS // CHUNK) / CHUNK,
            lambda: _time(bare, _STEPS // CHUNK) / CHUNK,
            "<= 2",
            "{:.1f} µs",
        )
    return [row]


def _local(name: str, file: Path) -> list[Result]:
    """One step with `RunningServer.local`, against the same without mjplug."""
    model = mujoco.MjModel.from_xml_path(str(file))
    control = np.full(model.nu, 0.1)
    bare = _bare_loop(model, control[None])
    with open_server(file, run=False, environ={}) as server:
        local = server.local
        chunk = np.tile(control, (CHUNK, 1))
        return [
            pairs(
                f"local.step, {name}, against mj_step with copies of qpos and qvel",
                lambda: _time(lambda: local.step(ctrl=control), _STEPS),
                lambda: _time(bare, _STEPS),
                "<= 20",
                "{:.1f} µs",
            ),
            pairs(
                f"one of {CHUNK} steps of local.rollout, {name}, against mj_step with copies of qpos and qvel",
                lambda: _time(lambda: local.rollout(chunk), _STEPS // CHUNK) / CHUNK,
                lambda: _time(bare, _STEPS),
                "<= 3",
                "{:.1f} µs",
            ),
        ]


def _states() -> list[Result]:
    """Saving and restoring a state in memory, against MuJoCo's own functions for a state."""
    with open_server("bundled:quadruped", plugins=["heartbeat", "external_wrench"], run=False, environ={}) as server:
        local, model = server.local, server.model
        local.step(200)
        data = mujoco.MjData(model)
        kind = mujoco.mjtState.mjSTATE_INTEGRATION
        vector = np.empty(mujoco.mj_stateSize(model, kind))
        local.save("start")

        def put_back() -> None:
            mujoco.mj_setState(model, data, vector, kind)
            mujoco.mj_forward(model, data)

        mujoco.mj_getState(model, data, vector, kind)
        return [
            pairs(
                "save_state in memory, in process, bundled quadruped, against mj_getState",
                lambda: _time(lambda: local.save("start", overwrite=True), 200),
                lambda: _time(lambda: mujoco.mj_getState(model, data, vector, kind), 200),
                "<= 1000",
                "{:.1f} µs",
            ),
            pairs(
                "restore_state from memory, in process, bundled quadruped, against mj_setState and mj_forward",
                lambda: _time(lambda: local.restore("start"), 200),
                lambda: _time(put_back, 200),
                "<= 50",
                "{:.1f} µs",
            ),
        ]


def _gym() -> Result:
    """Environment steps per second of a bundled task, in one process."""
    mjplug.gym.register_tasks()
    env = gymnasium.make("mjplug/ArmReach-v0").unwrapped
    env.reset(seed=0)
    action = np.zeros(2)

    def rate() -> float:
        return 1e6 / _time(lambda: env.step(action), 300)

    row = figure("environment steps/s of mjplug/ArmReach-v0 (10 physics steps each)", rate, ">= 1000", "{:.0f}/s")
    env.close()
    return row


def _bare_loop(model: mujoco.MjModel, controls: np.ndarray) -> Callable[[], object]:
    data = mujoco.MjData(model)

    def run() -> object:
        return [_bare_step(model, data, row) for row in controls]

    return run


def _bare_step(model: mujoco.MjModel, data: mujoco.MjData, row: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    data.ctrl[:] = row
    mujoco.mj_step(model, data)
    return data.qpos.copy(), data.qvel.copy()


def _time(act: Callable[[], object], count: int) -> float:
    """Returns the mean time of a call [µs]."""
    began = perf_counter()
    for _ in range(count):
        act()
    return (perf_counter() - began) / count * 1e6
