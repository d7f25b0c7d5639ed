"""Models written for `mujoco.plugin.lidar`, which MuJoCo itself does not have, load as they are."""

import zipfile

import mujoco
import numpy as np
import pytest

from mjplug.errors import ModelError
from mjplug.model.file import load_model
from mjplug.model.lidar_extension import lidar_sensors

CONFIG = {"resolution": "360 1", "azimuth_range": "-3.14159 3.14159", "elevation_range": "0", "max_range": "10"}


def config(**attributes):
    merged = CONFIG | attributes
    return "".join(f'<config key="{key}" value="{value}"/>' for key, value in merged.items() if value is not None)


def inline(inner, name='name="scan"', at='objtype="site" objname="s"'):
    return f'<plugin {name} plugin="mujoco.plugin.lidar" {at}>{inner}</plugin>'


def scene(sensors, extension='<plugin plugin="mujoco.plugin.lidar"/>', more=""):
    return f"""<mujoco model="scene">
  <extension>{extension}</extension>
  {more}
  <worldbody>
    <geom type="plane" size="5 5 1"/>
    <body name="carrier" pos="0 0 1"><freejoint/><geom size=".1"/><site name="s"/></body>
  </worldbody>
  <sensor>{sensors}</sensor>
</mujoco>"""


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def loaded(here, text, name="scene.xml"):
    (here / name).write_text(text, encoding="utf-8")
    return load_model(name).model


def refusal(here, text):
    with pytest.raises(ModelError) as caught:
        loaded(here, text)
    return str(caught.value).removeprefix(f"{here}/scene.xml")


def sensor_names(model):
    return [mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_SENSOR, i) for i in range(model.nsensor)]


def test_mujoco_itself_refuses_such_a_model():
    with pytest.raises(ValueError, match=r"mujoco\.plugin\.lidar"):
        mujoco.MjModel.from_xml_string(scene(inline(config())))


def test_a_sensor_keeps_its_name_its_site_and_its_place_among_the_others(here):
    sensors = f'<gyro name="before" site="s"/>{inline(config())}<gyro name="after" site="s"/>'
    model = loaded(here, scene(sensors))
    assert sensor_names(model) == ["before", "scan", "after"]
    assert model.sensor("scan").objid == model.site("s").id
    assert lidar_sensors(model)["scan"].site == model.site("s").id
    data = mujoco.MjData(model)
    data.qvel[3:] = (1, 2, 3)
    mujoco.mj_forward(model, data)
    assert data.sensor("before").data.tolist() == data.sensor("after").data.tolist() == [1, 2, 3]


def test_every_attribute_is_in_the_compiled_model(here):
    ranges = {"elevation_range": "-.25 0.25", "min_range": ".1", "max_range": "80"}
    inner = config(resolution="1024 16", update_rate="20", **ranges, **{"async": 1})
    assert lidar_sensors(loaded(here, scene(inline(inner))))["scan"].attributes == {
        "resolution": [1024, 16],
        "azimuth_range": [-3.14159, 3.14159],
        "elevation_range": [-0.25, 0.25],
        "min_range": 0.1,
        "max_range": 80.0,
        "update_rate": 20.0,
        "async": 1,
    }


@pytest.mark.parametrize("written", ["-1 1", " -1   1 ", "-1, 1", "-1,1", "-1.0\n 1e0", "-1 1,"])
def test_numbers_may_be_written_in_any_usual_way(here, written):
    model = loaded(here, scene(inline(config(azimuth_range=written))))
    assert lidar_sensors(model)["scan"].attributes["azimuth_range"] == [-1.0, 1.0]


def test_two_equal_elevations_are_one(here):
    model = loaded(here, scene(inline(config(elevation_range=".3 .3"))))
    assert lidar_sensors(model)["scan"].attributes["elevation_range"] == [0.3]


def test_a_named_instance_serves_several_sensors(here):
    extension = f'<plugin plugin="mujoco.plugin.lidar"><instance name="two_d">{config(max_range=7)}</instance></plugin>'
    sensors = (
        '<plugin name="a" plugin="mujoco.plugin.lidar" instance="two_d" objtype="site" objname="s"/>'
        '<plugin name="b" instance="two_d" objtype="site" objname="s"/>'
    )
    found = lidar_sensors(loaded(here, scene(sensors, extension)))
    assert list(found) == ["a", "b"]
    assert found["a"].attributes == found["b"].attributes
    assert found["b"].attributes["max_range"] == 7


def test_a_model_compiled_once_has_all_of_it_in_mujoco_s_own_format(here):
    mujoco.mj_saveModel(loaded(here, scene(inline(config()))), "scene.mjb")
    assert lidar_sensors(load_model("scene.mjb").model)["scan"].attributes["resolution"] == [360, 1]
    assert lidar_sensors(mujoco.MjModel.from_binary_path("scene.mjb"))["scan"].attributes["max_range"] == 10


def test_included_files_and_assets_are_found_as_before(here):
    """Extension, instance and sensor in three files, two of them in other folders, beside a mesh on disk."""
    for folder in ("parts", "meshes"):
        (here / folder).mkdir()
    corners = ["v 0 0 0", "v 1 0 0", "v 0 1 0", "v 0 0 1", "f 1 3 2", "f 1 2 4", "f 1 4 3", "f 2 3 4"]
    (here / "meshes" / "corner.obj").write_text("\n".join(corners))
    (here / "parts" / "extension.xml").write_text(
        f'<mujoco><extension><plugin plugin="mujoco.plugin.lidar"><instance name="i">{config()}</instance></plugin>'
        '</extension><include file="parts/deeper.xml"/></mujoco>'
    )
    (here / "parts" / "deeper.xml").write_text('<mujoco><worldbody><site name="deep"/></worldbody></mujoco>')
    (here.parent / "sensors.xml").write_text(
        '<mujoco><plugin name="scan" instance="i" objtype="site" objname="deep"/></mujoco>'
    )
    (here / "scene.xml").write_text(
        """<mujoco><compiler meshdir="meshes"/><asset><mesh file="corner.obj"/></asset>
        <include file="parts/extension.xml"/><worldbody><geom type="mesh" mesh="corner"/></worldbody>
        <sensor><include file="../sensors.xml"/></sensor></mujoco>"""
    )
    model = load_model("scene.xml").model
    assert model.nmesh == 1
    assert lidar_sensors(model)["scan"].site == model.site("deep").id


def test_nothing_is_written_beside_the_model(here):
    before = {"scene.xml": scene(inline(config()))}
    loaded(here, before["scene.xml"])
    assert {file.name: file.read_text() for file in here.iterdir()} == before


def test_an_attached_model_brings_its_lidars_under_its_prefix(here):
    (here / "robot.xml").write_text(scene(inline(config())))
    attach = '<attach model="robot" body="carrier" prefix="left_"/>'
    (here / "world.xml").write_text(
        f'<mujoco><asset><model name="robot" file="robot.xml"/></asset><worldbody>{attach}</worldbody></mujoco>'
    )
    model = load_model("world.xml").model
    assert lidar_sensors(model)["left_scan"].site == model.site("left_s").id


def test_a_replicated_site_has_a_lidar_for_each_copy(here):
    rig = '<replicate count="11" offset="1 0 0"><site name="s"/></replicate>'
    pairs = '<replicate count="2" offset="0 1 0" sep="-"><body name="pole"><site name="t"/></body></replicate>'
    sensors = inline(config()) + inline(config(max_range=7), 'name="scan1"', 'objtype="site" objname="t"')
    text = scene(sensors).replace('<site name="s"/>', "").replace("</worldbody>", f"{rig}{pairs}</worldbody>")
    model = loaded(here, text)
    found = lidar_sensors(model)
    numbers = [f"{i:02}" for i in range(11)]
    assert list(found) == [f"scan{number}" for number in numbers] + ["scan1-0", "scan1-1"]
    assert [found[f"scan{number}"].site for number in numbers] == [model.site(f"s{number}").id for number in numbers]
    assert [found[f"scan1-{i}"].attributes["max_range"] for i in range(2)] == [7, 7]
    assert found["scan10"].attributes["max_range"] == 10


@pytest.mark.parametrize("names", [["packed.xml"], ["model.xml"], ["parts.xml", "packed.xml"]])
def test_a_packed_model_loads(here, names):
    *others, main = names
    with zipfile.ZipFile("packed.mjz", "w") as archive:
        archive.writestr(main, scene(inline(config()), more="".join(f'<include file="{n}"/>' for n in others)))
        for name in others:
            archive.writestr(name, '<mujoco><worldbody><site name="other"/></worldbody></mujoco>')
    assert list(lidar_sensors(load_model("packed.mjz").model)) == ["scan"]


def test_names_may_have_any_letters(here):
    model = loaded(here, scene(inline(config(), name="name='größe &lt;2&quot;'")).replace('"s"', '"s &amp; t"'))
    assert lidar_sensors(model)['größe <2"'].site == model.site("s & t").id


def test_comments_that_name_the_plugin_do_not_matter(here):
    model = loaded(here, scene(f"<!-- {inline('')} -->{inline(config())}"))
    assert sensor_names(model) == ["scan"]


def test_a_sensor_without_a_name_keeps_its_place_and_is_reported(here, caplog):
    model = loaded(here, scene(f'{inline(config(), name="")}<gyro name="after" site="s"/>'))
    assert sensor_names(model) == [None, "after"]
    assert lidar_sensors(model) == {}
    (record,) = caplog.records
    assert record.getMessage() == f"{here}/scene.xml:8: lidar sensor without a name is not published; give it a name"


def test_mujoco_s_line_numbers_stay_right(here):
    inner = config().replace("/><", "/>\n<")
    assert refusal(here, scene(f'{inline(inner)}\n<gyro name="after" sit="s"/>')) == (
        ": XML Error: Schema violation: unrecognized attribute: 'sit'; Element 'gyro', line 12"
    )


def test_other_plugins_stay_mujoco_s_own_affair(here):
    both = '<plugin plugin="mujoco.plugin.lidar"/><plugin plugin="mujoco.plugin.radar"/>'
    assert refusal(here, scene(inline(config()), both)) == (
        ": XML Error: plugin mujoco.plugin.radar not found; Element 'plugin', line 2"
    )
    on_a_body = '<plugin plugin="mujoco.plugin.lidar"/>'
    assert "mujoco.plugin.lidar" in refusal(here, scene("").replace("<freejoint/>", f"<freejoint/>{on_a_body}"))


WRONG = [
    ({"resolution": None}, "resolution is missing; it must be two whole numbers above 0: columns and rows"),
    ({"resolution": "360"}, "resolution is '360'; it must be two whole numbers above 0: columns and rows"),
    ({"resolution": "0 1"}, "resolution is '0 1'; it must be two whole numbers above 0: columns and rows"),
    ({"resolution": "1.5 1"}, "resolution is '1.5 1'; it must be two whole numbers above 0: columns and rows"),
    ({"resolution": "many 1"}, "resolution is 'many 1'; it must be two whole numbers above 0: columns and rows"),
    (
        {"azimuth_range": "1 -1"},
        "azimuth_range is '1 -1'; it must be two angles from -pi to pi [rad], the lower one first",
    ),
    (
        {"azimuth_range": "-4 1"},
        "azimuth_range is '-4 1'; it must be two angles from -pi to pi [rad], the lower one first",
    ),
    (
        {"elevation_range": "0 1 2"},
        "elevation_range is '0 1 2'; it must be one angle, or two with the lower one first, ",
    ),
    (
        {"elevation_range": ""},
        "elevation_range is ''; it must be one angle, or two with the lower one first, from -pi to",
    ),
    ({"resolution": "9 2"}, "elevation_range is 0; 2 rows need two angles, the lower one first"),
    ({"max_range": "0"}, "max_range is '0'; it must be a number above 0 [m]"),
    ({"max_range": "inf"}, "max_range is 'inf'; it must be a number above 0 [m]"),
    ({"min_range": "-1"}, "min_range is '-1'; it must be a number not below 0 [m]"),
    ({"min_range": "10"}, "max_range is 10; it must be greater than min_range, which is 10"),
    ({"update_rate": "-1"}, "update_rate is '-1'; it must be a number not below 0 [Hz]; 0 is every step"),
    ({"async": "true"}, "async is 'true'; it must be a number; other than 0 means yes"),
    ({"max_rang": "1"}, "unknown attribute 'max_rang', did you mean 'max_range'?; known: async, azimuth_range, "),
]


@pytest.mark.parametrize(("change", "sentence"), WRONG, ids=[w[1] for w in WRONG])
def test_a_wrong_attribute_is_a_sentence_with_its_place(here, change, sentence):
    said = refusal(here, scene(inline(config(**change))))
    assert said.startswith(":8: lidar sensor 'scan': " + sentence)


def test_a_sensor_that_is_not_at_a_site_is_refused(here):
    sentence = ':8: lidar sensor \'scan\': a lidar needs a site; write objtype="site" objname="SITE"'
    assert refusal(here, scene(inline(config(), at='objtype="body" objname="carrier"'))) == sentence
    assert refusal(here, scene(inline(config(), at=""))) == sentence


def test_an_unknown_instance_is_refused_with_the_known_ones(here):
    extension = f'<plugin plugin="mujoco.plugin.lidar"><instance name="two_d">{config()}</instance></plugin>'
    sensor = '<plugin name="scan" plugin="mujoco.plugin.lidar" instance="2d" objtype="site" objname="s"/>'
    assert refusal(here, scene(sensor, extension)) == (
        ":8: lidar sensor 'scan': unknown instance of mujoco.plugin.lidar '2d'; known: two_d"
    )


def test_an_unknown_site_is_mujoco_s_own_error(here):
    said = refusal(here, scene(inline(config(), at='objtype="site" objname="nowhere"')))
    assert said.startswith(": Error: unrecognized name 'nowhere' of sensorized object; Element name 'scan'")


def test_a_model_without_lidars_has_none(here):
    assert lidar_sensors(loaded(here, "<mujoco/>")) == {}
    text = '<custom><text name="mujoco.plugin.lidar: gone" data="{}"/></custom>'
    assert lidar_sensors(mujoco.MjModel.from_xml_string(f"<mujoco>{text}</mujoco>")) == {}


def test_what_stands_for_a_lidar_costs_the_physics_one_number(here):
    model = loaded(here, scene(inline(config(resolution="2000 1"))))
    assert model.nsensordata == 1
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data)
    assert np.array_equal(data.sensordata, [0.0])
