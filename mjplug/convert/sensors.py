"""Writes sensors: those of `<gazebo>` and of `<ros2_control>`."""

import math
from dataclasses import dataclass, field
from typing import Any
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from mjplug.convert.materials import free_name
from mjplug.convert.mjcf import Mjcf
from mjplug.convert.read_urdf import floats
from mjplug.convert.report import Report
from mjplug.convert.rotations import IDENTITY, Array, numbers, pose, pose_attributes
from mjplug.convert.sensor_names import camera_topics, frame_of, topic_of
from mjplug.errors import ModelError

_CAMERAS = ("camera", "depth", "depth_camera", "rgbd", "rgbd_camera", "wideanglecamera", "multicamera")
_LIDARS = ("ray", "gpu_ray", "lidar", "gpu_lidar")
_FORWARD = np.array([[0.0, 0.0, -1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""Rotation of a MuJoCo camera that looks along the x axis of a link, with z upwards."""

_IMU = ("orientation", "angular_velocity", "linear_acceleration")
_MAX_PIXELS = 16384
"""Largest side of an image, which is that of the textures of usual graphics cards."""

_MAX_RAYS = 10_000_000

_TOPICS = ("frame_name", "info_topic", "image_topic", "depth_topic")


@dataclass(slots=True)
class SensorWriter:
    """Adds sensors to a model, and collects the parameters of their plugins.

    Attributes:
        mjcf: The model.
        report: The report.
        cameras: Parameters of the plugin `camera` by camera.
        lidars: Parameters of the plugin `lidar` by lidar.
        settings: Parameters of the plugin `sensors` by sensor.
        scans: Parameters of the plugin `rangefinder_lidar` by lidar.
    """

    mjcf: Mjcf
    report: Report
    cameras: dict[str, dict[str, Any]] = field(default_factory=dict)
    lidars: dict[str, dict[str, Any]] = field(default_factory=dict)
    settings: dict[str, dict[str, Any]] = field(default_factory=dict)
    scans: dict[str, dict[str, Any]] = field(default_factory=dict)
    _names: set[str] = field(default_factory=set)

    def write_gazebo(self, sensors: list[tuple[str, Element]]) -> None:
        """Adds the sensors of `<gazebo>` elements, at their links."""
        for link, element in sensors:
            kind = element.get("type", "")
            name = free_name(element.get("name") or kind, self._names)
            place = _pose_of(element, name)
            rate = _number(element, "update_rate", 0.0)
            frame, unknown = frame_of(element, self.mjcf.bodies)
            if unknown:
                self.report.add("loss", "frame of a sensor that is not a link; its own frame is used", name, unknown)
            if kind in _CAMERAS and element.find("camera") is not None:
                given = {"publish_rate": rate, "frame_name": frame} | camera_topics(element, kind)
                self._add_camera(link, name, place, element)
                self.cameras[name] = {key: value for key, value in given.items() if value}
            elif kind in _LIDARS:
                self._add_lidar(link, name, place, element, rate)
                if name in self.lidars:
                    given = {"topic": topic_of(element), "frame_name": frame}
                    self.lidars[name] |= {key: value for key, value in given.items() if value}
            elif kind in ("imu", "force_torque", "magnetometer"):
                self._add_sensor({"force_torque": "fts"}.get(kind, kind), name, self._site(link, name, place))
                given = {"rate": rate, "topic": topic_of(element), "frame_id": frame}
                self.settings[name] = {key: value for key, value in given.items() if value}
                self._note_convention(element, name)
            else:
                self.report.add("loss", "Gazebo sensor without a counterpart", name, kind)

    def write_control(self, sensors: list[Element]) -> None:
        """Adds the `<sensor>` elements of `<ros2_control>`, unless the model already contains them."""
        present = {element.get("name", "") for element in self.mjcf.section("sensor")}
        cameras = {element.get("name", "") for element in self.mjcf.root.iter("camera")}
        rangefinders = {element.get("name", "") for element in self.mjcf.section("sensor").iterfind("rangefinder")}
        for element in sensors:
            name = element.get("name", "")
            parameters = {found.get("name", ""): (found.text or "").strip() for found in element.findall("param")}
            if name in cameras:
                self.cameras.setdefault(name, {}).update(
                    {key: parameters[key] for key in _TOPICS if parameters.get(key)}
                )
                continue
            if name in rangefinders:
                self.scans[name] = {
                    key: floats(parameters[key], 1, f"{key} of sensor {name!r}")[0]
                    for key in ("range_min", "range_max")
                    if parameters.get(key)
                }
                if parameters.get("laserscan_topic"):
                    self.scans[name]["laserscan_topic"] = parameters["laserscan_topic"]
                continue
            kind = parameters.get("mujoco_type") or _kind_of(element)
            source = parameters.get("mujoco_sensor_name") or name
            if any(other == source or other.startswith(f"{source}_") for other in present):
                continue
            frame = parameters.get("frame_id") or parameters.get("frame_name") or name
            if kind not in ("imu", "fts", "pose", "magnetometer"):
                self.report.add("loss", "<ros2_control> sensor without a counterpart", name, kind)
            elif frame not in self.mjcf.bodies:
                self.report.add("loss", "<ros2_control> sensor without a link; give it a param frame_id", name, frame)
            else:
                self._add_sensor(kind, name, self._site(frame, name, IDENTITY))

    def _note_convention(self, element: Element, name: str) -> None:
        for path, default in (("force_torque/frame", "child"), ("force_torque/measure_direction", "child_to_parent")):
            given = (element.findtext(path) or default).strip()
            if given != default:
                self.report.add(
                    "loss", f"<{path.partition('/')[2]}> of a force-torque sensor; {default} is used", name, given
                )

    def _site(self, link: str, name: str, place: Array) -> str:
        """Returns the site of a sensor: that of the link, or one with the name of the sensor if its pose differs."""
        body = self.mjcf.bodies[link]
        same = np.allclose(place, IDENTITY)
        site = link if same else name
        if body.find(f"site[@name='{site}']") is None:
            body.append(Element("site", {"name": site, "group": "4", **pose_attributes(place)}))
        return site

    def _add_sensor(self, kind: str, name: str, site: str) -> None:
        section = self.mjcf.section("sensor")
        if kind == "imu":
            SubElement(section, "accelerometer", name=f"{name}_accel", site=site)
            SubElement(section, "gyro", name=f"{name}_gyro", site=site)
            SubElement(section, "framequat", name=f"{name}_quat", objtype="site", objname=site)
        elif kind == "fts":
            SubElement(section, "force", name=f"{name}_force", site=site)
            SubElement(section, "torque", name=f"{name}_torque", site=site)
        elif kind == "pose":
            SubElement(section, "framepos", name=f"{name}_pos", objtype="site", objname=site)
            SubElement(section, "framequat", name=f"{name}_quat", objtype="site", objname=site)
        else:
            SubElement(section, "magnetometer", name=name, site=site)

    def _add_camera(self, link: str, name: str, place: Array, element: Element) -> None:
        width, height = (
            int(_number(element, f"camera/image/{part}", size)) for part, size in (("width", 640), ("height", 480))
        )
        horizontal = _number(element, "camera/horizontal_fov", 1.047)
        if not (min(width, height) >= 1 and max(width, height) <= _MAX_PIXELS and horizontal > 0.0):
            raise ModelError(
                f"camera {name!r} has an image of {width} x {height} pixels and a horizontal_fov of {horizontal:g} "
                f"rad; the sides must be from 1 to {_MAX_PIXELS}, and the angle must be above zero"
            )
        vertical = 2.0 * math.atan(math.tan(min(horizontal, 3.0) / 2.0) * height / width)
        turned = place.copy()
        turned[:3, :3] = place[:3, :3] @ _FORWARD
        attributes = {"name": name, "fovy": numbers([math.degrees(vertical)], 6), "resolution": f"{width} {height}"}
        self.mjcf.bodies[link].append(Element("camera", attributes | pose_attributes(turned)))

    def _add_lidar(self, link: str, name: str, place: Array, element: Element, rate: float) -> None:
        scan = element.find("ray") if element.find("ray") is not None else element.find("lidar")
        if scan is None:
            self.report.add("loss", "Gazebo lidar without <ray> or <lidar>", name)
            return
        columns, azimuth = _angles(scan, "horizontal", 360)
        rows, elevation = _angles(scan, "vertical", 1)
        if columns * rows > _MAX_RAYS:
            raise ModelError(f"lidar {name!r} has {columns} x {rows} rays; at most {_MAX_RAYS} are allowed")
        circle = azimuth[1] - azimuth[0] > 2.0 * math.pi - 0.05
        if circle:
            azimuth = (-math.pi, math.pi)
        parameters: dict[str, Any] = {
            "site": self._site(link, name, place),
            "resolution": [columns, rows],
            "azimuth_range": [max(azimuth[0], -math.pi), min(azimuth[1], math.pi)],
            "elevation_range": [elevation[0], elevation[1]] if rows > 1 else [elevation[0]],
            "endpoint": not circle,
            "min_range": _number(scan, "range/min", 0.0),
            "max_range": _number(scan, "range/max", 30.0),
            "update_rate": rate or 10.0,
        }
        if azimuth[0] < -math.pi - 1e-3 or azimuth[1] > math.pi + 1e-3:
            self.report.add("loss", "part of a lidar's angles outside of -pi to pi", name)
        self.lidars[name] = parameters


def _kind_of(element: Element) -> str:
    """Returns the kind of a ros2_control sensor by its state interfaces."""
    states = [found.get("name", "").partition(".")[0] for found in element.findall("state_interface")]
    if any(state in _IMU for state in states):
        return "imu"
    if "force" in states or "torque" in states:
        return "fts"
    return "pose" if "position" in states else "unknown"


def _pose_of(element: Element, name: str) -> Array:
    values = floats(element.findtext("pose") or "0 0 0 0 0 0", 6, f"the pose of sensor {name!r}")
    return pose(values[:3], values[3:])


def _number(element: Element, path: str, default: float) -> float:
    text = element.findtext(path)
    return floats(text, 1, path)[0] if text and text.strip() else default


def _angles(scan: Element, direction: str, samples: int) -> tuple[int, tuple[float, float]]:
    """Returns the number of rays in a direction, and the angles of the first and the last one [rad]."""
    path = f"scan/{direction}"
    count = int(_number(scan, f"{path}/samples", samples) * _number(scan, f"{path}/resolution", 1.0))
    low, high = (-math.pi, math.pi) if direction == "horizontal" else (0.0, 0.0)
    return max(count, 1), (_number(scan, f"{path}/min_angle", low), _number(scan, f"{path}/max_angle", high))
