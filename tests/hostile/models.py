"""Spoilt models: MJCF and URDF with huge numbers, odd names, missing files, include loops and broken bytes."""

import re

from hostile.payloads import spoilt

VALUES = (
    "0",
    "-1",
    "1e308",
    "-1e308",
    "5e-324",
    "nan",
    "inf",
    "-inf",
    "1e999",
    "2147483647",
    "-2147483648",
    "4294967296",
    "1e10",
    "",
    " ",
    "x",
    "0 0 0 0 0 0 0 0 0 0",
    "1 2",
    "é",
    "&#1;",
    "&#x202e;",
    "a\nb",
    "a/b",
    "*",
    "%s%n%n",
    "../../../etc/passwd",
    "missing.png",
    "missing.stl",
    "included.xml",
    "true",
    "false",
    "null",
    "1e-320",
    "999999999999999999999",
)

NUMBERS = ("1e308", "1e30", "-1", "0", "nan", "1e9", "2147483647", "65536", "1e-300", "0.5", "3")

ELEMENTS = (
    '<include file="included.xml"/>',
    '<include file="missing.xml"/>',
    '<include file="model.xml"/>',
    '<size njmax="100000" nconmax="100000"/>',
    '<size memory="1P"/>',
    '<size memory="16E"/>',
    '<size nuser_body="1000000"/>',
    '<asset><texture name="t" type="2d" builtin="flat" width="100000" height="100000"/></asset>',
    '<asset><hfield name="h" nrow="30000" ncol="30000" size="1 1 1 1"/></asset>',
    '<asset><mesh name="m" file="missing.stl"/></asset>',
    '<asset><mesh name="m2" vertex="0 0 0 1 0 0 0 1 0"/></asset>',
    '<asset><mesh name="m3" vertex="0 0 0 1 0 0 0 1 0 0 0 1" face="0 1 9999"/></asset>',
    '<worldbody><replicate count="20000"><geom size=".1"/></replicate></worldbody>',
    '<worldbody><replicate count="-1"><geom size=".1"/></replicate></worldbody>',
    '<worldbody><composite type="cable" prefix="c" count="500 1 1" size="1"><geom size=".01"/></composite></worldbody>',
    '<worldbody><flexcomp name="f" type="grid" count="60 60 1" spacing=".1 .1 .1" radius=".01"/></worldbody>',
    '<worldbody><body name="world"/></worldbody>',
    '<worldbody><body name=""/><body name=""/></worldbody>',
    '<worldbody><camera name="c" resolution="100000 100000"/></worldbody>',
    '<option timestep="0"/>',
    '<option timestep="1e-300"/>',
    '<option timestep="1e300"/>',
    '<option timestep="-1"/>',
    '<option gravity="nan 0 0"/>',
    '<extension><plugin plugin="mujoco.plugin.lidar"/></extension>',
    '<extension><plugin plugin="nothing"/></extension>',
    '<keyframe><key name="k" qpos="1e999"/></keyframe>',
    '<keyframe><key name="k" time="nan"/></keyframe>',
    '<custom><numeric name="n" size="500000000"/></custom>',
    '<custom><text name="t" data="\u00e9"/></custom>',
    '<default><default class="main"/></default>',
    '<compiler angle="x"/>',
    '<statistic extent="0"/>',
    '<visual><global offwidth="1000000" offheight="1000000"/></visual>',
    "<!DOCTYPE x>",
    "<?x y?>",
    "<![CDATA[x]]>",
)

URDF = (
    '<robot name="r"><link name="base"/>{}<joint name="j" type="revolute"><parent link="base"/><child link="tip"/>'
    '<axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint><link name="tip"><inertial>'
    '<mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
    '<collision><geometry><box size=".1 .1 .1"/></geometry></collision></link></robot>'
)
URDF_ELEMENTS = (
    "",
    '<link name="base"/>',
    '<link name=""/>',
    "<link/>",
    '<joint name="k" type="x"/>',
    '<link name="m"><collision><geometry><mesh filename="package://nothing/x.stl"/></geometry></collision></link>',
    '<link name="m"><collision><geometry><mesh filename="missing.stl"/></geometry></collision></link>',
    '<link name="m"><collision><geometry><mesh filename="x.dae"/></geometry></collision></link>',
    '<link name="m"><collision><geometry><mesh filename="file:///dev/null.stl"/></geometry></collision></link>',
    '<link name="m"><collision><geometry><mesh filename="a&#10;b.stl"/></geometry></collision></link>',
    '<link name="m"><collision><geometry><mesh/></geometry></collision></link>',
    '<mujoco><compiler discardvisual="x" meshdir="\u00e9"/></mujoco>',
    '<mujoco><compiler fusestatic="maybe"/></mujoco>',
    '<joint name="loop" type="fixed"><parent link="tip"/><child link="base"/></joint>',
)


def spoilt_model(random, models):
    """Returns the bytes of a model, and the ending of its name."""
    kind = random.random()
    if kind < 0.15:
        text = URDF.format(random.choice(URDF_ELEMENTS))
        if random.random() < 0.6:
            text = _attributes(text, random)
        return (spoilt(text.encode(), random) if random.random() < 0.3 else text.encode()), ".urdf"
    content = random.choice([model for model in models if b"<mujoco" in model])
    if kind < 0.30:
        return spoilt(content, random), ".xml"
    if kind < 0.34:
        return random.choice((b"", b"\0" * 100, content[:64], b"\xff" * 1000, random.randbytes(2000))), random.choice(
            (".mjb", ".mjz", ".xml", ".urdf")
        )
    text = content.decode()
    if kind < 0.60:
        for _ in range(random.choice((1, 2, 3))):
            text = text.replace("</mujoco>", f"{random.choice(ELEMENTS)}\n</mujoco>")
    elif kind < 0.95:
        text = _attributes(text, random)
    else:
        depth = random.choice((10, 300, 2000, 20_000))
        nested = "<body>" * depth + '<geom size=".1"/>' + "</body>" * random.choice((depth, 0))
        text = f"<mujoco><worldbody>{nested}</worldbody></mujoco>"
    raw = text.encode()
    if random.random() < 0.1:
        # Names that are no UTF-8.
        raw = raw.replace(b'name="', b'name="\xe9', random.choice((1, 3)))
    return raw, ".xml"


def _attributes(text, random):
    """Returns XML with other values of some attributes, or other elements."""
    for _ in range(random.choice((1, 1, 2, 4, 8))):
        places = list(re.finditer(r'="([^"]*)"', text))
        if not places:
            break
        place = random.choice(places)
        value = random.choice(VALUES)
        numbers = place[1].split()
        if numbers and re.fullmatch(r"-?[\d.]+", numbers[0]) and random.random() < 0.7:
            numbers[random.randrange(len(numbers))] = random.choice(NUMBERS)
            value = " ".join(numbers)
        value = value.replace("<", "&lt;").replace('"', "&quot;")
        text = f"{text[: place.start(1)]}{value}{text[place.end(1) :]}"
    if random.random() < 0.3:
        tags = list(re.finditer(r"<[a-z]+", text))
        tag = random.choice(tags)
        other = random.choice(("body", "joint", "geom", "x", "site", "freejoint"))
        text = f"{text[: tag.start()]}<{other}{text[tag.end() :]}"
    return text
