"""Publishes what describes the robot: a URDF, or the model itself."""

from pathlib import Path
from xml.etree import ElementTree

import mujoco
from pydantic import Field

from mjplug.plugin import LATCHED, Host, Parameters, Plugin, PluginError
from mjplug_schemas.std_msgs import String

_COMPILED = (".mjb", ".mjz")


class RobotDescriptionParameters(Parameters):
    """Parameters of RobotDescription."""

    file: str = Field(
        default="",
        description="URDF, or another text: relative to the configuration, or package://; empty is the model.",
    )
    topic: str = Field(default="{ns}/robot_description", description="Topic name.")


class RobotDescription(Plugin[RobotDescriptionParameters]):
    """Publishes a URDF, or the model as MJCF, as `std_msgs/String` for those who come at any time."""

    def init(self, host: Host, parameters: RobotDescriptionParameters) -> None:
        """Reads the file and publishes it."""
        if parameters.file:
            text = _read(host.find_file(parameters.file))
        elif host.model_file is None:
            raise PluginError("the model comes from no file; give file, the robot's URDF")
        elif host.model_file.suffix.lower() in _COMPILED:
            raise PluginError(f"{host.model_file.name} is a compiled model, no text; give file, the robot's URDF")
        else:
            text = _read(host.model_file)
        host.create_publisher(String, parameters.topic, LATCHED).publish(String(data=text))


def _read(path: Path) -> str:
    """Returns the text of an XML file; MJCF that includes others comes in one piece.

    Raises:
        PluginError: It cannot be read, or is no XML.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
        root = ElementTree.fromstring(text)
    except (OSError, ValueError) as error:
        raise PluginError(f"{path} cannot be read: {error}") from error
    except ElementTree.ParseError as error:
        raise PluginError(f"{path} is no XML: {error}") from error
    if "\0" in text:
        raise PluginError(f"{path} has a NUL character, which no ROS string has")
    if root.tag == "mujoco" and next(root.iter("include"), None) is not None:
        return _in_one_piece(path)
    return text


def _in_one_piece(path: Path) -> str:
    try:
        spec = mujoco.MjSpec.from_file(str(path))
        spec.compile()
        text: str = spec.to_xml()
    except (ValueError, mujoco.FatalError) as error:
        raise PluginError(f"{path} includes other files, and cannot be put together: {error}; give file") from error
    return text
