"""The configuration of a server for a converted robot."""

from dataclasses import dataclass
from typing import Any

import yaml

from mjplug.convert.robot import Joint, Robot
from mjplug.convert.scene import HOME, SCENE_FILE


@dataclass(frozen=True, slots=True)
class Configuration:
    """The plugins for a robot.

    Attributes:
        robot: The robot.
        free: Whether its root link is free.
        wheels: Its wheels.
    """

    robot: Robot
    free: bool
    wheels: list[Joint]

    def plugins(self) -> dict[str, dict[str, Any]]:
        """Returns the plugin instances by name."""
        drives = self.free and len(self.wheels) >= 2
        result: dict[str, dict[str, Any]] = {
            "joint_state_publisher": {"type": "joint_state_publisher"},
            "joint_commands": {"type": "joint_commands"},
            "transforms": {"type": "transforms"},
            "robot_description": {"type": "robot_description", "file": "robot.urdf"},
        }
        if drives:
            root = self.robot.root
            result["transforms"]["roots"] = [root]
            result["odometry"] = {"type": "odometry", "body": root, "origin": "start", "publish_tf": True}
        return result

    def content(self) -> dict[str, Any]:
        """Returns the whole configuration."""
        return {"model": SCENE_FILE, "sim": {"keyframe": HOME}, "plugins": self.plugins()}

    def text(self) -> str:
        """Returns the configuration as YAML."""
        comment = "# mjplug serve mjplug.yaml\n"
        return comment + yaml.safe_dump(self.content(), sort_keys=False, default_flow_style=None, width=120)
