"""Reads `<mujoco_inputs>` of mujoco_ros2_control: from the URDF, and from files."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from mjplug.convert.decompose import THRESHOLD
from mjplug.convert.options import MAX_THRESHOLD, MIN_THRESHOLD
from mjplug.convert.read_urdf import floats
from mjplug.errors import ModelError, did_you_mean

_TAG = "mujoco_inputs"
_SECTIONS = ("raw_inputs", "processed_inputs", "scene")
_PROCESSED = ("decompose_mesh", "camera", "lidar", "modify_element")

_MAX_RAYS = 4096
"""Largest number of rangefinders of a lidar: the time to compile them grows with the square of their number."""


@dataclass(frozen=True, slots=True)
class Lidar:
    """Rangefinders in a row: angles about the z axis of a link, from its x axis [rad]."""

    link: str
    sensor: str
    min_angle: float
    increment: float
    count: int


@dataclass(slots=True)
class MujocoInputs:
    """The inputs of all elements and files, in their order.

    Attributes:
        raw: Sections of MJCF that are copied.
        scenes: Sections of MJCF of the scene.
        cameras: Cameras with the links at which they are.
        lidars: Lidars.
        changes: `<modify_element>` elements.
        decompose: Thresholds of meshes by the names of their files, without suffix.
    """

    raw: list[Element] = field(default_factory=list)
    scenes: list[Element] = field(default_factory=list)
    cameras: list[tuple[str, Element]] = field(default_factory=list)
    lidars: list[Lidar] = field(default_factory=list)
    changes: list[Element] = field(default_factory=list)
    decompose: dict[str, float] = field(default_factory=dict)
    exist: bool = False


def read_inputs(root: Element, files: Iterable[str]) -> MujocoInputs:
    """Reads the inputs in a URDF and in files.

    Args:
        root: The `<robot>`.
        files: Files whose root is `<mujoco_inputs>`, or a `<robot>` that contains one.

    Raises:
        ModelError: A file cannot be read, or an element is unknown, incomplete or there twice.
    """
    inputs = MujocoInputs()
    for element in root.iterfind(_TAG):
        _read(element, inputs, f"<{_TAG}>")
    for name in files:
        found = _file(Path(name))
        for element in found:
            _read(element, inputs, name)
    return inputs


def _file(path: Path) -> list[Element]:
    try:
        root = ElementTree.parse(path).getroot()
    except OSError as error:
        raise ModelError(f"{path} cannot be read: {error.strerror}") from error
    except ElementTree.ParseError as error:
        raise ModelError(f"{path} is not valid XML: {error}") from error
    if root.tag == _TAG:
        return [root]
    if root.tag != "robot":
        raise ModelError(f"{path}: the root element is <{root.tag}>; it must be <{_TAG}> or <robot>")
    found = root.findall(_TAG)
    if not found:
        raise ModelError(f"{path} contains no <{_TAG}>")
    return found


def _read(element: Element, inputs: MujocoInputs, place: str) -> None:
    inputs.exist = True
    seen = set()
    for section in element:
        if section.tag not in _SECTIONS:
            raise ModelError(f"{place}: unknown section <{section.tag}>; known: {', '.join(_SECTIONS)}")
        if section.tag in seen:
            raise ModelError(f"{place} contains <{section.tag}> twice")
        seen.add(section.tag)
        if section.tag == "raw_inputs":
            inputs.raw += list(section)
        elif section.tag == "scene":
            inputs.scenes += list(section)
        else:
            for part in section:
                _read_processed(part, inputs, place)


def _read_processed(part: Element, inputs: MujocoInputs, place: str) -> None:
    if part.tag == "decompose_mesh":
        name = _required(part, "mesh_name", place)
        if name in inputs.decompose:
            raise ModelError(f"{place}: two <decompose_mesh> name the mesh {name!r}")
        threshold = floats(part.get("threshold", str(THRESHOLD)), 1, f"threshold of mesh {name!r}")[0]
        if not MIN_THRESHOLD <= threshold <= MAX_THRESHOLD:
            raise ModelError(
                f"{place}: the threshold of mesh {name!r} is {threshold:g}; it must be from {MIN_THRESHOLD:g} to "
                f"{MAX_THRESHOLD:g}"
            )
        inputs.decompose[name] = threshold
    elif part.tag == "camera":
        link, name = _required(part, "site", place), _required(part, "name", place)
        if any(camera.get("name") == name for _, camera in inputs.cameras):
            raise ModelError(f"{place}: two cameras have the name {name!r}")
        attributes = {key: value for key, value in part.attrib.items() if key not in ("site", "pos", "quat")}
        inputs.cameras.append((link, Element("camera", attributes)))
    elif part.tag == "lidar":
        _read_lidar(part, inputs, place)
    elif part.tag == "modify_element":
        _required(part, "type", place)
        inputs.changes.append(part)
    else:
        near = did_you_mean(part.tag, _PROCESSED)
        raise ModelError(
            f"{place}: unknown element <{part.tag}> in processed_inputs{near}; known: {', '.join(_PROCESSED)}"
        )


def _read_lidar(part: Element, inputs: MujocoInputs, place: str) -> None:
    link, sensor = _required(part, "ref_site", place), _required(part, "sensor_name", place)
    low, high, increment = (
        floats(_required(part, name, place), 1, f"{name} of lidar {sensor!r}")[0]
        for name in ("min_angle", "max_angle", "angle_increment")
    )
    if increment <= 0.0 or high < low:
        raise ModelError(
            f"{place}: lidar {sensor!r} has the angles {low:g} to {high:g} with an increment of {increment:g}; the "
            "increment must be above zero, and max_angle must not be below min_angle"
        )
    if any(lidar.sensor == sensor for lidar in inputs.lidars):
        raise ModelError(f"{place}: two lidars have the sensor_name {sensor!r}")
    # A quotient such as 0.6 / 0.025 is not exactly 24.
    steps = (high - low) / increment + 1e-9
    if not steps < _MAX_RAYS:
        raise ModelError(
            f"{place}: lidar {sensor!r} has {steps + 1:.0f} rangefinders, at most {_MAX_RAYS} are allowed; increase "
            "angle_increment, or use the plugin lidar"
        )
    inputs.lidars.append(Lidar(link, sensor, low, increment, int(steps) + 1))


def _required(part: Element, attribute: str, place: str) -> str:
    value = part.get(attribute, "")
    if not value:
        raise ModelError(f"{place}: a <{part.tag}> has no attribute {attribute!r}")
    return value
