"""Lidar rays per second, with messages but without the network, compared with a loop of MuJoCo's own call."""

import logging
from collections.abc import Callable
from time import perf_counter
from typing import Any

import mujoco
import numpy as np

from benchmarks.frame_publisher import FramePublisher
from benchmarks.measure import Result, pairs
from mjplug.plugin import Job
from mjplug_plugins.lidar.parameters import LidarParameters
from mjplug_plugins.lidar.pattern import directions
from mjplug_plugins.lidar.settings import Settings, settings_of
from mjplug_plugins.lidar.work import LidarWork

COLUMNS, ROWS, SCAN = 1024, 64, 1080

SECONDS = 0.3
"""Wall time of one measurement [s]."""


def results() -> list[Result]:
    """Measures a cloud of 65,536 points and a scan, including encoding and the copy for Zenoh."""
    room, crowd = _scene(30, 0), _scene(40, 60)
    cloud = f"{COLUMNS} x {ROWS} cloud"
    return [
        _compared(f"lidar rays/s, {cloud}, 30 static geoms", room, ROWS, 1, ">= 0.9"),
        _compared(f"lidar rays/s, {cloud}, 40 static geoms and 60 bodies", crowd, ROWS, 1, ">= 0.9"),
        _compared(f"lidar rays/s, {cloud}, 30 static geoms, 2 threads", room, ROWS, 2, ">= 1.2"),
        _compared(f"lidar rays/s, scan of {SCAN}, 30 static geoms", room, 1, 1, ">= 0.9"),
    ]


def _compared(what: str, model: mujoco.MjModel, rows: int, threads: int, goal: str) -> Result:
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    columns = COLUMNS if rows > 1 else SCAN
    given: dict[str, Any] = {
        "site": "eye",
        "resolution": (columns, rows),
        "azimuth_range": (-np.pi, np.pi),
        "elevation_range": (-0.4, 0.4) if rows > 1 else (0.0,),
        "max_range": 100.0,
    }
    settings = settings_of(model, "lidar", None, LidarParameters(**given), (0,))
    work = LidarWork([settings], threads)
    work.open(model, [FramePublisher()], logging.getLogger(__name__))
    job = Job(0, 0, frozenset({"lidar"}))
    try:
        return pairs(
            what,
            lambda: _rate(columns * rows, lambda: work.perform(data, job)),
            _bare(model, data, settings),
            goal,
            "{:.2f} M rays/s",
        )
    finally:
        work.close()


def _bare(model: mujoco.MjModel, data: mujoco.MjData, settings: Settings) -> Callable[[], float]:
    """Returns a function that measures MuJoCo's call alone, with rays that are rotated only once."""
    rays = (directions(settings) @ data.site("eye").xmat.reshape(3, 3).T).reshape(-1)
    count = len(rays) // 3
    distances, geoms = np.empty(count), np.empty(count, np.int32)
    origin, body = data.site("eye").xpos, int(model.site("eye").bodyid[0])

    def cast() -> None:
        mujoco.mj_multiRay(model, data, origin, rays, None, True, body, geoms, distances, None, count, 100.0)

    return lambda: _rate(count, cast)


def _rate(rays: int, scan: Callable[[], object]) -> float:
    """Returns millions of rays per second of wall time."""
    began = perf_counter()
    scans = 0
    while (elapsed := perf_counter() - began) < SECONDS:
        scan()
        scans += 1
    return scans * rays / elapsed / 1e6


def _scene(static: int, bodies: int) -> mujoco.MjModel:
    """Returns a model with floor, walls, and shapes around a lidar on a robot."""
    random = np.random.default_rng(0)
    kinds = ["box", "sphere", "capsule", "cylinder", "ellipsoid"]

    def geom(i: int, position: str) -> str:
        turn = random.uniform(0, 180)
        return f'<geom type="{kinds[i % 5]}" size=".3 .2 .4" euler="{turn} 20 30" pos="{position}"/>'

    def around() -> str:
        angle, away = random.uniform(-np.pi, np.pi), random.uniform(1.5, 9)
        return f"{away * np.cos(angle)} {away * np.sin(angle)} {random.uniform(0.2, 2)}"

    furniture = "".join(geom(i, around()) for i in range(static - 5))
    movable = "".join(f'<body pos="{around()}"><freejoint/>{geom(i, "0 0 0")}</body>' for i in range(bodies))
    return mujoco.MjModel.from_xml_string(f"""
    <mujoco><worldbody>
      <geom type="plane" size="0 0 1"/>
      <geom type="box" size=".1 10 2" pos="10 0 2"/><geom type="box" size=".1 10 2" pos="-10 0 2"/>
      <geom type="box" size="10 .1 2" pos="0 10 2"/><geom type="box" size="10 .1 2" pos="0 -10 2"/>
      {furniture}{movable}
      <body name="robot" pos="0 0 .8"><freejoint/><geom size=".2"/><site name="eye"/></body>
    </worldbody></mujoco>""")
