"""Publishes a description of the robot: a URDF, or the model."""

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
        description="URDF or other XML file, relative to the configuration, or package://; empty: the model.",
    )
    topic: str = Field(default="{ns}/robot_description", description="Topic name.")


class RobotDescription(Plugin[RobotDescriptionParameters]):
    """Publishes a URDF, or the model as MJCF, as `std_msgs/String`; late subscribers get it too."""

    stateless = True

    def init(self, host: Host, parameters: RobotDescriptionParameters) -> None:
        """Reads the file and publishes it."""
        if parameters.file:
            text = _read(host.find_file(parameters.file))
        elif host.model_file is None:
            raise PluginError("the model was not loaded from a file; set `file` to the robot's URDF")
        elif host.model_file.suffix.lower() in _COMPILED:
            raise PluginError(
                f"{host.model_file.name} is a compiled model, not a text file; set `file` to the robot's URDF"
            )
        else:
            text = _read(host.model_file)
        host.create_publisher(String, parameters.topic, LATCHED).publish(String(data=text))


def _read(path: Path) -> str:
    """Returns the text of an XML file; files that an MJCF file includes are merged into it.

    Raises:
        PluginError: The file cannot be read, or is not XML.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
        root = ElementTree.fromstring(text)
    except (OSError, ValueError) as error:
        raise PluginError(f"{path} cannot be read: {error}") from error
    except ElementTree.ParseError as error:
        raise PluginError(f"{path} is not XML: {error}") from error
    if "\0" in text:
        raise PluginError(f"{path} contains a NUL character, which a ROS string cannot contain")
    if root.tag == "mujoco" and next(root.iter("include"), None) is not None:
        return _merge_includes(path)
    return text


def _merge_includes(path: Path) -> str:
    try:
        spec = mujoco.MjSpec.from_file(str(path))
        spec.compile()
        text: str = spec.to_xml()
    except (ValueError, mujoco.FatalError) as error:
        raise PluginError(f"{path} includes other files and they cannot be merged: {error}; set `file`") from error
    return text
