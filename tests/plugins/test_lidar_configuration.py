"""What can be set of a lidar, and what is refused."""

import math
import textwrap

import mujoco
import numpy as np
import pytest
from docs.markdown import rows, section

from mjplug.config.load import read
from mjplug.config.problem import ConfigError
from mjplug.errors import MjplugError
from mjplug.model.file import load_model
from mjplug.plugin.selection import select
from mjplug.testing import World
from mjplug_plugins.lidar import Lidar
from mjplug_plugins.lidar.parameters import LidarParameters
from mjplug_plugins.lidar.settings import MAX_RAYS

XML = """
<mujoco>
  <extension><plugin plugin="mujoco.plugin.lidar"/></extension>
  <option timestep="0.01" gravity="0 0 0"/>
  <worldbody>
    <geom name="wall" type="box" size=".1 5 5" pos="5.1 0 0"/>
    <geom name="curtain" type="box" size=".1 5 5" pos="4.1 0 0" contype="0" conaffinity="0" group="2"/>
    <geom name="shelf" type="box" size=".1 5 5" pos="3.1 0 0" group="1"/>
    <body name="robot"><freejoint/><geom type="sphere" size=".5"/><site name="inside"/>
      <body name="mast" pos="0 0 1"><geom type="sphere" size=".1"/><site name="top"/></body>
      <body name="hand" pos="1.5 0 1"><geom name="hand" type="sphere" size=".5"/></body></body>
    <site name="fixed" pos="2.5 0 1"/>
  </worldbody>
  <sensor>
    <plugin name="front" plugin="mujoco.plugin.lidar" objtype="site" objname="top">
      <config key="resolution" value="3 1"/><config key="azimuth_range" value="-.1 .1"/>
      <config key="elevation_range" value="0"/><config key="max_range" value="20"/>
      <config key="update_rate" value="20"/></plugin>
  </sensor>
</mujoco>
"""

FREE = {"resolution": (3, 1), "azimuth_range": (-0.1, 0.1), "elevation_range": (0.0,), "max_range": 20.0}


@pytest.fixture
def model(tmp_path):
    (tmp_path / "m.xml").write_text(XML)
    return load_model(str(tmp_path / "m.xml")).model


@pytest.fixture
def ahead(model):
    """Returns what the middle ray measures, with some parameters for the model's own lidar."""

    def measure(**parameters):
        world = World(model)
        world.add(Lidar, "lidar", front=parameters)
        world.loop.step(100)
        return world.published("/scan")[-1].ranges[1]

    return measure


def test_the_configuration_overrides_the_model(model):
    world = World(model)
    world.add(Lidar, "lidar", front={"update_rate": 50.0, "resolution": (5, 1), "max_range": 2.0, "min_range": 0.5})
    world.loop.step(100)
    scans = world.published("/scan")
    assert len(scans) == 50
    assert len(scans[0].ranges) == 5
    assert (scans[0].range_min, scans[0].range_max, scans[0].scan_time) == (0.5, 2.0, np.float32(0.02))
    assert scans[0].angle_min == np.float32(-0.1)


def test_a_lidar_of_the_model_can_be_put_at_another_site(ahead):
    assert ahead(site="fixed") == pytest.approx(0.5)


def test_a_lidar_needs_no_more_than_a_site(model):
    world = World(model)
    world.add(Lidar, "lidar", mine=FREE | {"site": "fixed", "topic": "/mine"})
    world.loop.step(100)
    scans = world.published("/mine")
    assert [len(world.published(topic)) for topic in ("/scan", "/mine")] == [20, 10]
    assert scans[0].ranges == pytest.approx((0.5 / math.cos(0.1), 0.5, 0.5 / math.cos(0.1)))


def test_the_sensor_s_own_body_is_not_seen_unless_asked_for(ahead):
    assert ahead() == pytest.approx(1.0)
    assert ahead(exclude_body=[]) == pytest.approx(0.1)


def test_other_bodies_can_be_left_out(ahead):
    assert ahead(exclude_body=["mast", "hand"]) == pytest.approx(3.0)
    assert ahead(exclude_body="hand") == pytest.approx(0.1)


def test_a_lidar_that_stands_in_the_world_sees_the_world(ahead):
    assert ahead(site="fixed", exclude_body=None) == pytest.approx(0.5)
    assert ahead(site="fixed", exclude_body="world") == math.inf


def test_geom_groups_can_be_left_out(ahead):
    assert ahead(exclude_body=("mast", "hand")) == pytest.approx(3.0)
    assert ahead(exclude_body=("mast", "hand"), geomgroup=(1, 0, 1, 1, 1, 1)) == pytest.approx(4.0)
    assert ahead(exclude_body=("mast", "hand"), geomgroup=(1, 0, 0, 0, 0, 0)) == pytest.approx(5.0)
    assert ahead(geomgroup=(0, 0, 0, 0, 0, 0)) == math.inf


def test_groups_in_which_nothing_collides_can_be_left_out(model, ahead):
    model.geom_group[model.geom("shelf").id] = 2
    both = {"exclude_body": ("mast", "hand"), "geomgroup": "colliding"}
    assert ahead(**both) == pytest.approx(3.0)
    model.geom_group[model.geom("shelf").id] = 0
    model.geom_pos[model.geom("shelf").id, 0] = 9
    assert ahead(**both) == pytest.approx(5.0)
    assert ahead(exclude_body=("mast", "hand")) == pytest.approx(4.0)


def cloud_world(seed=0, name="lidar", **parameters):
    xml = '<mujoco><worldbody><geom type="sphere" size="3"/><site name="eye"/></worldbody></mujoco>'
    world = World(mujoco.MjModel.from_xml_string(xml))
    plugin, host = Lidar(), world.host(name, seed=seed)
    settings = {"site": "eye", "resolution": (200, 50), "azimuth_range": (-3.0, 3.0), "elevation_range": (-1.0, 1.0)}
    lidars = {"cloud": settings | {"max_range": 10.0} | parameters}
    plugin.init(host, Lidar.parameters_type(**lidars))
    return world


def distances(world, steps=50):
    """All distances of one cloud, row by row."""
    world.loop.step(steps)
    cloud = world.published("/points")[-1]
    return np.linalg.norm(np.frombuffer(cloud.data, "<f4").reshape(-1, 3).astype(float), axis=1)


def test_noise_is_gaussian_with_its_standard_deviation():
    noise = distances(cloud_world(noise_std=0.02)) - 3
    assert abs(noise.mean()) < 4 * 0.02 / 100
    assert noise.std() == pytest.approx(0.02, rel=0.03)
    # Of a normal distribution 68.3 % lie within one deviation.
    assert (np.abs(noise) < 0.02).mean() == pytest.approx(0.683, abs=0.02)


def test_noise_does_not_lead_out_of_the_range():
    measured = distances(cloud_world(noise_std=0.5, min_range=2.9, max_range=3.1))
    assert np.isfinite(measured).all()
    assert measured.min() == pytest.approx(2.9)
    assert measured.max() == pytest.approx(3.1)


def test_noise_leaves_rays_without_a_distance_alone():
    assert np.isnan(distances(cloud_world(noise_std=0.5, max_range=2.9))).all()
    assert np.isnan(distances(cloud_world(noise_std=0.5, min_range=3.1))).all()


def test_rays_drop_out_with_their_probability():
    lost = np.isnan(distances(cloud_world(dropout=0.2)))
    assert lost.mean() == pytest.approx(0.2, abs=0.02)
    assert np.isnan(distances(cloud_world(dropout=1.0))).all()


def test_noise_is_the_same_in_every_run_and_another_with_every_seed_instance_and_instant():
    settings = {"noise_std": 0.02, "dropout": 0.1}
    first = distances(cloud_world(**settings))
    assert np.array_equal(first, distances(cloud_world(**settings)), equal_nan=True)
    others = [cloud_world(seed=1, **settings), cloud_world(name="other", **settings)]
    for other in [*map(distances, others), distances(cloud_world(**settings), 100)]:
        assert not np.array_equal(first, other, equal_nan=True)


def test_noise_does_not_depend_on_scans_that_were_dropped():
    one, two = cloud_world(noise_std=0.02), cloud_world(noise_std=0.02)
    two.workers.workers["lidar"].hold()
    two.loop.step(100)
    two.workers.workers["lidar"].release()
    assert np.array_equal(distances(one, 100), distances(two, 0))


def test_threads_change_nothing():
    one = World(mujoco.MjModel.from_xml_string(open_plane()))
    many = World(mujoco.MjModel.from_xml_string(open_plane()))
    for world, threads in ((one, 1), (many, 3)):
        world.add(Lidar, "lidar", threads=threads, cloud=FREE | {"site": "eye", "resolution": (600, 9)} | SLOPE)
        world.loop.step(50)
    assert one.published("/points") == many.published("/points")
    many.workers.close()


SLOPE = {"elevation_range": (-1.0, -0.2)}


def open_plane():
    return """<mujoco><worldbody><geom type="plane" size="0 0 1"/><geom size="1" pos="3 0 0"/>
    <site name="eye" pos="0 0 1"/></worldbody></mujoco>"""


def refusal(model, **parameters):
    with pytest.raises(MjplugError) as caught:
        World(model).add(Lidar, "lidar", **parameters)
    return str(caught.value)


def test_an_unknown_lidar_is_refused_with_the_known_ones(model):
    assert refusal(model, frontt={}) == (
        "unknown lidar 'frontt', did you mean 'front'?; known: front; for a lidar that is not in the model, these "
        "parameters are missing: site, resolution, azimuth_range, elevation_range, max_range"
    )


def test_a_lidar_without_a_site_gets_an_error_that_names_the_site(model):
    assert refusal(model, mine=FREE).endswith("these parameters are missing: site")


def test_what_a_new_lidar_lacks_is_reported(model):
    assert refusal(model, mine={"site": "top"}) == (
        "lidar 'mine': these parameters are missing: resolution, azimuth_range, elevation_range, max_range"
    )


def test_unknown_sites_and_bodies_are_refused_with_the_known_ones(model):
    assert refusal(model, mine=FREE | {"site": "tip"}) == (
        "unknown site 'tip', did you mean 'top'?; known: fixed, inside, top"
    )
    assert refusal(model, front={"exclude_body": "hands"}) == (
        "unknown body 'hands', did you mean 'hand'?; known: hand, mast, robot, world"
    )


def test_what_does_not_fit_together_is_refused(model):
    assert refusal(model, front={"min_range": 20.0}) == ("lidar 'front': max_range (20) must be above min_range (20)")
    assert refusal(model, front={"resolution": (9, 2)}) == (
        "lidar 'front': 2 rows need two angles in elevation_range, not one (0)"
    )
    assert refusal(model, front={"resolution": (90000, 90000), "elevation_range": (0.0, 0.1)}) == (
        "lidar 'front': 90000 x 90000 rays; at most 5000000 are allowed"
    )


def test_lidars_that_share_a_topic_are_reported(model, caplog):
    world = World(model)
    world.add(Lidar, "lidar", mine=FREE | {"site": "fixed"}, cloud=FREE | {"site": "top", "resolution": (2, 2)} | SLOPE)
    assert [r.getMessage() for r in caplog.records] == ["lidars front, mine publish on the same topic, /scan"]
    world.loop.step(100)
    assert len(world.published("/scan")) + len(world.published("/points")) > 0


def test_a_model_without_lidars_is_reported(box_world, caplog):
    box_world.add(Lidar, "lidar")
    assert [r.getMessage() for r in caplog.records] == [
        "the model has no mujoco.plugin.lidar sensor and no lidar is configured: nothing is published"
    ]


def test_every_parameter_of_a_lidar_has_a_row_in_the_docs():
    text = section("plugins.md", "Lidar")
    assert set(LidarParameters.model_fields) <= set(rows(text))
    assert f"at most {MAX_RAYS} rays" in text


OURS = """
model: bundled:arm
plugins:
  lidar:
    type: lidar
    threads: 2
    scan:
      site: tip
      resolution: [360, 1]
      azimuth_range: [-3.1416, 3.1416]
      elevation_range: 0
      min_range: 0.1
      max_range: 10
      update_rate: 20
      geomgroup: [1, 1, 1, 0, 0, 0]
      exclude_body: tool
      noise_std: 0.01
      dropout: 0.01
      no_return: .nan
"""


def selected_of(tmp_path, text):
    (tmp_path / "mjplug.yaml").write_text(textwrap.dedent(text))
    return select(read(tmp_path / "mjplug.yaml"))[1][0]


def test_a_configuration_is_read_as_it_is_written(tmp_path):
    parameters = selected_of(tmp_path, OURS).parameters
    scan = parameters.__pydantic_extra__["scan"]
    assert parameters.threads == 2
    assert (scan.resolution, scan.elevation_range, scan.exclude_body) == ((360, 1), (0.0,), ("tool",))
    assert (scan.max_range, scan.geomgroup) == (10.0, (1, 1, 1, 0, 0, 0))
    assert math.isnan(scan.no_return)


@pytest.mark.parametrize("resolution", ["360", "[360]", "[360, 1]"])
def test_one_number_is_the_resolution_of_a_single_row(tmp_path, resolution):
    parameters = selected_of(tmp_path, OURS.replace("[360, 1]", resolution)).parameters
    assert parameters.__pydantic_extra__["scan"].resolution == (360, 1)


WRONG = [
    (("max_range: 10", "max_rang: 10"), "scan.max_rang: unknown key; known: azimuth_range, "),
    (("threads: 2", "thread: 2"), "thread: unknown key; known: job_timeout, priority, sync, threads"),
    (("threads: 2", "threads: 0"), "threads: Input should be greater than or equal to 1, not 0"),
    (("max_range: 10", "max_range: 0.1"), "scan.max_range: max_range (0.1) must be above min_range (0.1)"),
    (("[360, 1]", "[0, 1]"), "scan.resolution[0]: Input should be greater than or equal to 1, not 0"),
    (("[360, 1]", "0"), "scan.resolution: Input should be greater than or equal to 1, not 0"),
    (("[360, 1]", "[1, 2, 3]"), "scan.resolution: Value should have at most 2 items"),
    (("[360, 1]", "3.5"), "scan.resolution: Input should be a whole number, not 3.5"),
    (("[-3.1416, 3.1416]", "[1, -1]"), "scan.azimuth_range: the first angle (1) must be below the second (-1)"),
    (
        ("[-3.1416, 3.1416]", "[-180, 180]"),
        "scan.azimuth_range[1]: Input should be less than or equal to 3.1416, not 180",
    ),
    (("elevation_range: 0", "elevation_range: []"), "scan.elevation_range: Value should have at least 1 item"),
    (("dropout: 0.01", "dropout: 2"), "scan.dropout: Input should be less than or equal to 1, not 2"),
    (("noise_std: 0.01", "noise_std: -1"), "scan.noise_std: Input should be greater than or equal to 0, not -1"),
    (
        ("[1, 1, 1, 0, 0, 0]", "visible"),
        "scan.geomgroup: Input should be 'all' or 'colliding' or a list, not 'visible'",
    ),
    (("[1, 1, 1, 0, 0, 0]", "[1, 1, 1, 0, 0]"), "scan.geomgroup[5]: required, but not given"),
    (("update_rate: 20", "update_rate: -1"), "scan.update_rate: Input should be greater than or equal to 0, not -1"),
    (("no_return: .nan", "no_return: none"), "scan.no_return: Input should be 'rep117' or a number, not 'none'"),
]


@pytest.mark.parametrize(("change", "sentence"), WRONG, ids=[w[0][1] for w in WRONG])
def test_a_wrong_parameter_is_reported_in_its_place(tmp_path, change, sentence):
    assert change[0] in OURS
    with pytest.raises(ConfigError) as caught:
        selected_of(tmp_path, OURS.replace(*change))
    text = OURS.replace(*change)
    line = text.splitlines().index(next(x for x in text.splitlines() if change[1] in x)) + 1
    found = [(p.mark.line, p.message.removeprefix("plugins.lidar.")) for p in caught.value.problems]
    assert any(at == line and message.startswith(sentence) for at, message in found), found
