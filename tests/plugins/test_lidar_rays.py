"""Every cast ray equals `mj_ray`, in all scenes."""

import math
from contextlib import contextmanager

import mujoco
import numpy as np
import pytest

from mjplug_plugins.lidar.casting import Caster, casting_model

GEOMS = ["box", "sphere", "capsule", "cylinder", "ellipsoid", "mesh", "plane", "hfield"]

MOVABLE = [kind for kind in GEOMS if kind != "plane"]
"""MuJoCo has planes in static bodies only."""

HILLS = " ".join(f"{(7 * i % 10) / 10}" for i in range(20))

ASSETS = f"""
<mesh name="mesh_0" vertex="0 0 0 4 0 0 0 3 0 0 0 2 4 3 0"/>
<mesh name="mesh_1" builtin="sphere" params="2"/>
<mesh name="mesh_2" builtin="supersphere" params="8 .5 .5"/>
<hfield name="hills" nrow="5" ncol="4" size="3 2 1 .1" elevation="{HILLS}"/>
"""


def numbers(values):
    return " ".join(map(str, values))


def random_geom(random, static=True):
    """Any kind, thin or thick, near or far, colliding or not, visible or not, sometimes right along the axes."""
    kind = random.choice(GEOMS if static else MOVABLE)
    size = random.choice([0.05, 0.3, 1, 4]) * random.uniform(0.2, 1, 3)
    if random.random() < 0.2:
        size[random.integers(3)] = 1e-3
    position = random.normal(size=3) * random.choice([0.5, 2, 8])
    turn = random.uniform(-180, 180, 3) if random.random() < 0.6 else random.choice([0, 45, 90, 180], 3)
    if random.random() < 0.3:
        position = np.round(position)
    shape = {
        "mesh": f'mesh="mesh_{random.integers(3)}"',
        "hfield": 'hfield="hills"',
        "plane": f'size="{random.choice([0, size[0]])} {random.choice([0, size[1]])} 1"',
    }.get(kind, f'size="{numbers(size)}"')
    visual = 'contype="0" conaffinity="0"' if random.random() < 0.4 else ""
    invisible = 'rgba="1 1 1 0"' if random.random() < 0.1 else ""
    return (
        f'<geom type="{kind}" {shape} pos="{numbers(position)}" euler="{numbers(turn)}" '
        f'group="{random.integers(6)}" {visual} {invisible}/>'
    )


def random_body(random, joint):
    geoms = "".join(random_geom(random, not joint) for _ in range(random.integers(6)))
    inertial = '<inertial pos=".3 .2 .1" mass="1" diaginertia="1 1 1"/>' if random.random() < 0.5 or joint else ""
    where = f'pos="{numbers(2 * random.normal(size=3))}" euler="{numbers(random.uniform(-180, 180, 3))}"'
    return f"<body {where}>{joint}{inertial}{geoms}</body>"


def random_scene(random):
    static = "".join(random_geom(random) for _ in range(random.integers(5)))
    bodies = "".join(random_body(random, random.choice(["", "<freejoint/>"])) for _ in range(random.integers(6)))
    return f"<mujoco><asset>{ASSETS}</asset><worldbody>{static}{bodies}</worldbody></mujoco>"


def grid(columns=37, rows=19, turned=None):
    azimuth, elevation = np.meshgrid(np.linspace(-np.pi, np.pi, columns), np.linspace(-np.pi / 2, np.pi / 2, rows))
    level = np.cos(elevation)
    rays = np.stack([np.cos(azimuth) * level, np.sin(azimuth) * level, np.sin(elevation)], -1).reshape(-1, 3)
    return rays if turned is None else np.ascontiguousarray(rays @ turned.T)


def state_of(xml, random=None):
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    if random is not None:
        data.qpos[:] += 0.5 * random.normal(size=model.nq)
    mujoco.mj_forward(model, data)
    return model, data


@contextmanager
def hiding(model, seen):
    """Puts what is seen into group 0 and all else into group 1; yields the flags that show group 0."""
    groups = model.geom_group.copy()
    model.geom_group[:] = ~seen
    yield np.array([1, 0, 0, 0, 0, 0], np.uint8)
    model.geom_group[:] = groups


def one_by_one(model, data, origin, rays, seen):
    """Casts each ray alone: the independent computation."""
    geom = np.zeros(1, np.int32)
    with hiding(model, seen) as flags:
        return np.array([mujoco.mj_ray(model, data, origin, ray, flags, True, -1, geom) for ray in rays])


def all_at_once(caster, model, data, origin, rays, seen, farthest=mujoco.mjMAXVAL):
    distances, geoms = np.empty(len(rays)), np.empty(len(rays), np.int32)
    caster.pose(data)
    caster.cast(np.asarray(origin, float), rays, (~seen).astype(np.int32), farthest, distances, geoms)
    return distances


def up_to(farthest, distances):
    return np.where((distances < 0) | (distances > farthest), -1.0, distances)


def bare(model, data, origin, rays, seen):
    """MuJoCo's own call for many rays."""
    distances, geoms, far = np.empty(len(rays)), np.empty(len(rays), np.int32), mujoco.mjMAXVAL
    with hiding(model, seen) as flags:
        mujoco.mj_multiRay(
            model, data, origin, rays.reshape(-1), flags, True, -1, geoms, distances, None, len(rays), far
        )
    return distances


@pytest.mark.parametrize("seed", range(6))
def test_every_ray_of_random_scenes_equals_mj_ray(seed):
    random = np.random.default_rng(seed)
    hits = missed_without_care = 0
    for _ in range(40):
        model, data = state_of(random_scene(random), random)
        turned = np.linalg.qr(random.normal(size=(3, 3)))[0] if random.random() < 0.6 else np.eye(3)
        origin, rays = random.normal(size=3) * random.choice([0, 0.3, 2]), grid(turned=turned)
        seen = random.random(model.ngeom) < random.choice([0.7, 1.0])
        farthest = random.choice([5.0, 1e10])
        expected = up_to(farthest, one_by_one(model, data, origin, rays, seen))
        got = up_to(farthest, all_at_once(Caster(model), model, data, origin, rays, seen, farthest))
        np.testing.assert_allclose(got, expected, rtol=0, atol=1e-12)
        hits += (expected >= 0).sum()
        missed_without_care += (up_to(farthest, bare(model, data, origin, rays, seen)) != expected).sum()
    # The scenes are full, and such that MuJoCo's own call misses things in them.
    assert hits > 5000
    assert missed_without_care > 50


def wrong_rays(xml, origin=(0.0, 0.0, 0.0)):
    """Returns in how many rays our result and that of the bare call differ from mj_ray."""
    model, data = state_of(xml)
    origin, rays, seen = np.array(origin), grid(181, 91), np.ones(model.ngeom, bool)
    expected = one_by_one(model, data, origin, rays, seen)
    assert (expected >= 0).any()
    ours = all_at_once(Caster(model), model, data, origin, rays, seen)
    return int((ours != expected).sum()), int((bare(model, data, origin, rays, seen) != expected).sum())


VISUAL = 'contype="0" conaffinity="0"'


@pytest.mark.parametrize(
    "world",
    [
        f'<geom size=".1" pos="0 0 5"/><geom size="1" pos="5 0 -1" {VISUAL}/>',
        f'<geom size=".1" pos="0 0 5"/><geom type="plane" size="0 0 1" pos="0 0 -1" {VISUAL}/>',
        f'<body pos="3 0 0"><geom size=".1"/><geom size=".5" pos="0 3 0" {VISUAL}/></body>',
        '<body pos="2 0 0" euler="0 0 90"><geom size=".1" pos="1 0 0" mass="10"/><geom size=".2" pos="-1 0 0"/>'
        f'<geom size=".2" pos="-1 0 1"/><geom size=".3" pos="0 2 0" {VISUAL}/></body>',
    ],
    ids=["far from what collides", "a plane", "in a moving body", "a turned body with many geoms"],
)
def test_what_the_bare_call_misses_is_seen(world):
    ours, bares = wrong_rays(f"<mujoco><worldbody>{world}</worldbody></mujoco>")
    assert ours == 0
    assert bares > 0


@pytest.mark.parametrize(
    "world",
    [
        f'<geom size="1" pos="3 0 0" {VISUAL}/><body pos="0 2 0"><geom size=".4" {VISUAL}/></body>',
        "".join(f'<body pos="{i} 2 0"><geom size=".2"/><geom size=".3" pos="0 1 0"/></body>' for i in range(9)),
        "".join(
            f'<body pos="{i} 2 0"><geom size=".2"/><geom size=".3" pos="0 1 0"/><geom size=".3" pos="0 -7 0"/></body>'
            for i in range(9)
        ),
        '<geom size="1"/>',
        '<geom type="box" size="2 3 1"/>',
        '<body pos="2 0 0" euler="0 0 90"><geom type="box" size=".1 .1 .1" pos="1 0 0" mass="10"/>'
        '<geom type="box" size=".2 .2 .2" pos="-1 0 0" mass=".1"/></body>',
    ],
    ids=[
        "nothing collides",
        "small bodies",
        "only large bodies",
        "from inside a sphere",
        "from inside a box",
        "a turned body",
    ],
)
def test_other_layouts_of_bodies(world):
    assert wrong_rays(f"<mujoco><worldbody>{world}</worldbody></mujoco>")[0] == 0


def test_a_plane_is_seen_however_far_its_origin_is():
    model, data = state_of('<mujoco><worldbody><geom type="plane" size="0 0 1" pos="500 0 -1"/></worldbody></mujoco>')
    rays = np.array([[0, 0, -1.0], [math.sqrt(0.5), 0, -math.sqrt(0.5)]])
    got = all_at_once(Caster(model), model, data, (0, 0, 0), rays, np.ones(1, bool), farthest=10.0)
    assert got == pytest.approx([1, math.sqrt(2)])


def test_several_threads_find_what_one_finds():
    random = np.random.default_rng(1)
    model, data = state_of(random_scene(random), random)
    origin, rays, seen = np.array([0.1, 0.2, 0.3]), grid(201, 51), np.ones(model.ngeom, bool)
    expected = one_by_one(model, data, origin, rays, seen)
    for threads in (2, 3, 7):
        caster = Caster(model, threads)
        try:
            assert np.array_equal(all_at_once(caster, model, data, origin, rays, seen), expected)
            few = rays[::500]
            assert np.array_equal(all_at_once(caster, model, data, origin, few, seen), expected[::500])
        finally:
            caster.close()


def test_the_threads_follow_the_state():
    model, data = state_of(
        '<mujoco><worldbody><body><freejoint/><geom type="box" size="1 1 1"/></body></worldbody></mujoco>'
    )
    caster, rays = Caster(model, 2), grid(101, 51)
    try:
        for height in (3.0, -4.0, 0.0):
            data.qpos[:3] = (0.2, 0, height)
            mujoco.mj_kinematics(model, data)
            expected = one_by_one(model, data, np.zeros(3), rays, np.ones(1, bool))
            assert np.array_equal(all_at_once(caster, model, data, (0, 0, 0), rays, np.ones(1, bool)), expected)
    finally:
        caster.close()


def test_the_model_that_is_given_stays_as_it_is():
    model, _ = state_of(random_scene(np.random.default_rng(3)))
    arrays = {name: getattr(model, name).copy() for name in ("body_geomnum", "body_bvhadr", "bvh_aabb", "geom_rbound")}
    casting_model(model)
    for name, before in arrays.items():
        assert np.array_equal(getattr(model, name), before)


def test_an_empty_model_has_nothing_to_see():
    model, data = state_of("<mujoco/>")
    got = all_at_once(Caster(model), model, data, (0, 0, 0), grid(), np.ones(0, bool))
    assert (got == -1).all()
