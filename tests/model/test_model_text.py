"""Models whose text is not UTF-8: a sentence when they are loaded, and no UnicodeDecodeError at any time."""

import mujoco
import pytest

from mjplug.errors import ModelError
from mjplug.model.file import load_model

REMEDY = "save the model's files in UTF-8"

ELEMENTS = {
    "body 1": b'<worldbody><body name="caf\xe9"/></worldbody>',
    "joint 0": b'<worldbody><body><joint name="caf\xe9"/><geom size="1"/></body></worldbody>',
    "geom 1": b"<worldbody><geom size='1'/><geom size='1' name='caf\xe9'/></worldbody>",
    "site 0": b'<worldbody><site name="caf\xe9"/></worldbody>',
    "camera 0": b'<worldbody><camera name="caf\xe9"/></worldbody>',
    "material 0": b'<asset><material name="caf\xe9"/></asset>',
    "sensor 1": b'<sensor><clock name="a"/><clock name="caf\xe9"/></sensor>',
    "keyframe 2": b'<keyframe><key name="a"/><key/><key name="caf\xe9"/></keyframe>',
    "numeric 0": b'<custom><numeric name="caf\xe9" data="1"/></custom>',
}


def refusal(path):
    with pytest.raises(ModelError) as caught:
        load_model(str(path))
    return str(caught.value)


@pytest.mark.parametrize("element", ELEMENTS)
def test_a_name_that_is_not_utf_8_is_refused_with_its_element_and_line(tmp_path, element):
    file = tmp_path / "latin1.xml"
    file.write_bytes(b"<mujoco>\n\n" + ELEMENTS[element] + b"\n</mujoco>")
    assert refusal(file) == f"{file}:3: the name of {element} is not UTF-8: 'caf\\xe9'; {REMEDY}"


def test_a_model_s_own_name_that_is_not_utf_8_is_refused(tmp_path):
    file = tmp_path / "latin1.xml"
    file.write_bytes(b'<mujoco model="\xe9t\xe9"/>')
    assert refusal(file) == f"{file}:1: the name of the model is not UTF-8: '\\xe9t\\xe9'; {REMEDY}"


def test_a_name_in_an_included_or_a_compiled_file_is_refused_with_the_file_that_was_given(tmp_path):
    (tmp_path / "part.xml").write_bytes(b"<mujoco>" + ELEMENTS["body 1"] + b"</mujoco>")
    (tmp_path / "whole.xml").write_text('<mujoco><include file="part.xml"/></mujoco>')
    expected = "{}: the name of body 1 is not UTF-8: 'caf\\xe9'; " + REMEDY
    assert refusal(tmp_path / "whole.xml") == expected.format(tmp_path / "whole.xml")
    mujoco.mj_saveModel(mujoco.MjModel.from_xml_path(str(tmp_path / "whole.xml")), str(tmp_path / "whole.mjb"))
    assert refusal(tmp_path / "whole.mjb") == expected.format(tmp_path / "whole.mjb")


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (b'<worldbody><geom size="1" material="caf\xe9"/></worldbody>', "material 'caf\\xe9' not found in geom 0"),
        (b'<worldbody><geom size="1" caf\xe9="1"/></worldbody>', "unrecognized attribute: 'caf\\xe9'"),
        (b'<asset><mesh name="a" file="caf\xe9.stl"/></asset>', "Error opening file 'caf\\xe9.stl'"),
        (b'<worldbody><body name="\xe9"/><body name="\xe9"/></worldbody>', "repeated name '\\xe9' in body"),
    ],
    ids=["reference", "attribute", "file", "twice"],
)
def test_mujoco_s_errors_about_text_that_is_not_utf_8_are_readable(tmp_path, text, sentence):
    file = tmp_path / "latin1.xml"
    file.write_bytes(b"<mujoco>" + text + b"</mujoco>")
    said = refusal(file)
    assert sentence in said
    assert said.endswith(REMEDY)
    assert "codec" not in said


def test_text_that_names_nothing_may_have_any_encoding(tmp_path):
    (tmp_path / "comment.xml").write_bytes(b'<mujoco model="m"><!-- caf\xe9 --></mujoco>')
    assert load_model(str(tmp_path / "comment.xml")).name == "m"


def test_names_of_other_alphabets_are_utf_8(tmp_path):
    (tmp_path / "names.xml").write_text(
        '<mujoco model="café"><worldbody><body name="腕"/></worldbody></mujoco>', encoding="utf-8"
    )
    loaded = load_model(str(tmp_path / "names.xml"))
    assert (loaded.name, loaded.model.body(1).name) == ("café", "腕")
