"""The configuration of a server for a converted robot."""

from dataclasses import dataclass, field
from typing import Any

import yaml

from mjplug.convert.inputs import Lidar
from mjplug.convert.pid_gains import Gains
from mjplug.convert.robot import Robot
from mjplug.convert.scene import HOME, SCENE_FILE
from mjplug.convert.sensors import SensorWriter
from mjplug.convert.transmissions import Transmission
from mjplug.convert.wheels import DriveTrain


@dataclass(frozen=True, slots=True)
class Configuration:
    """The plugins for a robot.

    Attributes:
        robot: The robot.
        free: Whether its root link is free.
        train: Its differential drive.
        sensors: Its sensors.
        scans: Lidars that consist of rangefinders.
        transmissions: Its transmissions.
        gains: PID gains of its joints and actuators.
    """

    robot: Robot
    free: bool
    train: DriveTrain | None
    sensors: SensorWriter
    scans: list[Lidar]
    transmissions: list[Transmission] = field(default_factory=list)
    gains: Gains = field(default_factory=dict)

    def plugins(self) -> dict[str, dict[str, Any]]:
        """Returns the plugin instances by name."""
        result: dict[str, dict[str, Any]] = {
            "joint_state_publisher": {"type": "joint_state_publisher"},
            "joint_commands": {
                "type": "joint_commands",
                "topic": "{ns}/joint_commands",
                "trajectory_topic": "{ns}/joint_trajectory",
            },
            "transforms": {"type": "transforms"},
            "robot_description": {"type": "robot_description", "file": "robot.urdf"},
        }
        if self.gains:
            hold = {"hold_at_start": True} if "position" in self.gains else {}
            result["joint_commands"] |= {"pid_gains": self.gains} | hold
        if self.transmissions:
            transmissions = {found.name: found.parameters() for found in self.transmissions}
            result["joint_commands"]["transmissions"] = transmissions
            result["actuator_states"] = {
                "type": "joint_state_publisher",
                "topic": "{ns}/mujoco_actuators_states",
                "order": "actuators",
                "side": "actuators",
                "transmissions": transmissions,
            }
        if self.free and self.train is not None:
            root = self.robot.root
            result["transforms"]["roots"] = [root]
            result["odometry"] = {"type": "odometry", "body": root, "origin": "start", "publish_tf": True}
            result["diff_drive"] = {
                "type": "diff_drive",
                "body": root,
                "wheels": list(self.train.wheels),
                "wheel_radius": self.train.radius,
            }
            if self.train.slips:
                result["diff_drive"]["wheel_separation_multiplier"] = self.train.multiplier
        result |= self._sensor_plugins()
        self._add_frames(result["transforms"])
        return result

    def _add_frames(self, transforms: dict[str, Any]) -> None:
        """Adds the sites of lidars to the frames; by default, only sites of MuJoCo's sensors are frames."""
        own = {lidar["site"] for lidar in self.sensors.lidars.values()} - set(self.robot.links)
        if own:
            section = self.sensors.mjcf.section("sensor")
            measured = {element.get("site", element.get("objname", "")) for element in section}
            replicated = {lidar.sensor for lidar in self.scans}
            transforms["sites"] = sorted((own | measured) - replicated - set(self.robot.links) - {""})

    def _sensor_plugins(self) -> dict[str, dict[str, Any]]:
        mjcf, sensors = self.sensors.mjcf, self.sensors
        result: dict[str, dict[str, Any]] = {}
        scans = {lidar.sensor: lidar for lidar in self.scans}
        rays = [element for element in mjcf.section("sensor") if element.get("site") in scans]
        single = [element for element in mjcf.section("sensor") if element not in rays]
        if single:
            result["sensors"] = {"type": "sensors"} | {name: given for name, given in sensors.settings.items() if given}
        if rays:
            named = {ray.get("name", ""): scans[ray.get("site", "")] for ray in rays if ray.get("name")}
            several = len(named) + _flat_count(sensors.lidars) > 1
            result["rangefinder_lidar"] = {"type": "rangefinder_lidar"} | {
                name: _scan(lidar)
                | ({"laserscan_topic": f"{{ns}}/{name}/scan"} if several else {})
                | sensors.scans.get(name, {})
                for name, lidar in named.items()
            }
        if next(mjcf.root.iter("camera"), None) is not None:
            result["camera"] = {"type": "camera"} | {name: given for name, given in sensors.cameras.items() if given}
        if sensors.lidars:
            result["lidar"] = {"type": "lidar"} | _with_topics(sensors.lidars, len(rays) > 0)
        return result

    def content(self) -> dict[str, Any]:
        """Returns the whole configuration."""
        return {"model": SCENE_FILE, "sim": {"keyframe": HOME}, "plugins": self.plugins()}

    def text(self) -> str:
        """Returns the configuration as YAML; what two plugins have in common is an alias in it."""
        comment = "# mjplug serve mjplug.yaml\n"
        return comment + yaml.safe_dump(self.content(), sort_keys=False, default_flow_style=None, width=120)


def _scan(lidar: Lidar) -> dict[str, Any]:
    """Returns the parameters of a lidar that consists of rangefinders."""
    return {
        "frame_name": lidar.link,
        "min_angle": lidar.min_angle,
        "max_angle": round(lidar.min_angle + (lidar.count - 1) * lidar.increment, 12),
        "angle_increment": lidar.increment,
    }


def _flat_count(lidars: dict[str, dict[str, Any]]) -> int:
    return sum(lidar["resolution"][1] == 1 for lidar in lidars.values())


def _with_topics(lidars: dict[str, dict[str, Any]], others: bool) -> dict[str, dict[str, Any]]:
    """Adds topics if several lidars would publish on the same one.

    Args:
        lidars: Parameters of the plugin `lidar` by lidar.
        others: Whether lidars that consist of rangefinders publish scans too.
    """
    flat = [name for name, lidar in lidars.items() if lidar["resolution"][1] == 1]
    deep = [name for name in lidars if name not in flat]
    topics = {name: f"{{ns}}/{name}/scan" for name in flat if len(flat) + others > 1}
    topics |= {name: f"{{ns}}/{name}/points" for name in deep if len(deep) > 1}
    topics = {name: topic for name, topic in topics.items() if "topic" not in lidars[name]}
    return {name: lidar | ({"topic": topics[name]} if name in topics else {}) for name, lidar in lidars.items()}
