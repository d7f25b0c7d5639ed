"""The scenes: each robot fits into each of them, and holds its pose there."""

import mujoco
import numpy as np
import pytest
from model_files import tetrahedron

from convert.robots import ARM, BOX, ROVER, at_home, converted, joint, link, robot
from mjplug.convert.scene import scene_names
from mjplug.errors import ModelError


def test_the_library():
    assert scene_names() == ["floor", "obstacles", "tabletop"]


@pytest.mark.parametrize("scene", ["floor", "tabletop", "obstacles"])
@pytest.mark.parametrize("text", [ARM, ROVER], ids=["arm", "rover"])
def test_every_robot_stands_still_in_every_scene(tmp_path, scene, text):
    _, model = converted(tmp_path, text, scene=scene)
    assert model.nkey == 1
    data = at_home(model)
    begin = data.qpos.copy()
    mujoco.mj_step(model, data, 500)
    assert np.abs(data.qpos - begin).max() < 0.02, "also the things in the scene"
    assert not any(int(warning.number) for warning in data.warning)


def test_a_scene_is_not_needed(tmp_path):
    _, model = converted(tmp_path, ARM, scene="none")
    assert (model.nlight, model.nkey) == (0, 1)


def test_an_arm_is_mounted_on_the_table_and_a_rover_stands_before_it(tmp_path):
    _, model = converted(tmp_path, ARM, scene="tabletop")
    data = at_home(model)
    mujoco.mj_forward(model, data)
    table = data.geom("table_top")
    assert table.xpos[2] + 0.02 == pytest.approx(-0.051), "below the lowest point of the upper arm"
    assert np.abs(table.xpos[:2]).max() < 0.5
    assert data.geom("floor").xpos[2] == pytest.approx(-0.801)
    _, model = converted(tmp_path, ROVER, scene="tabletop")
    data = at_home(model)
    mujoco.mj_forward(model, data)
    assert data.geom("table_top").xpos[0] - 0.75 > 0.4
    assert data.geom("floor").xpos[2] == 0.0


def test_the_floor_is_below_an_arm_that_hangs_down(tmp_path):
    text = robot(link("base", shape=BOX), link("a", shape=BOX), joint("j", "base", "a", xyz="0 0 -0.5"))
    _, model = converted(tmp_path, text, base="fixed")
    assert model.geom("floor").pos[2] == pytest.approx(-0.551, abs=1e-6)


def test_height_fields_of_a_scene_are_in_the_folder_of_its_meshes(tmp_path):
    (tmp_path / "meshes").mkdir()
    rows = columns = 2
    heights = np.array([rows, columns], np.int32).tobytes() + np.zeros(rows * columns, np.float32).tobytes()
    (tmp_path / "meshes" / "hill.bin").write_bytes(heights)
    (tmp_path / "mine.xml").write_text(
        '<mujoco><compiler meshdir="meshes"/><asset><hfield name="hill" file="hill.bin" size="1 1 0.1 0.1"/></asset>'
        '<worldbody><geom type="hfield" hfield="hill"/></worldbody></mujoco>'
    )
    conversion, model = converted(tmp_path, ARM, scene=str(tmp_path / "mine.xml"))
    assert (model.nhfield, "assets/hill.bin" in conversion.files) == (1, True)


def test_a_scene_of_the_user_keeps_its_assets(tmp_path):
    tetrahedron(tmp_path / "meshes" / "rock.stl", 0.3)
    scene = (
        '<mujoco><compiler meshdir="meshes"/><asset><mesh file="rock.stl"/></asset><worldbody>'
        '<body pos="3 0 1"><freejoint/><geom type="mesh" mesh="rock"/></body></worldbody></mujoco>'
    )
    (tmp_path / "mine.xml").write_text(scene)
    conversion, model = converted(tmp_path, ARM, scene=str(tmp_path / "mine.xml"))
    assert model.nmesh == 1
    assert "assets/rock.stl" in conversion.files
    assert model.key("home").qpos.size == model.nq == 9
    (tmp_path / "mine.xml").write_text(scene.replace("rock.stl", "stone.stl"))
    with pytest.raises(ModelError, match=r"the scene needs .*stone\.stl, which cannot be read"):
        converted(tmp_path, ARM, scene=str(tmp_path / "mine.xml"))
    (tmp_path / "mine.xml").write_text("<robot/>")
    with pytest.raises(ModelError, match="is not an MJCF file: its root element is <robot>"):
        converted(tmp_path, ARM, scene=str(tmp_path / "mine.xml"))
