"""Loads models with `mujoco.plugin.lidar`, a sensor of mujoco_ros2_control that MuJoCo itself does not provide.

MuJoCo refuses such a model when parsing it, so the model is changed in memory: MuJoCo reads copies of the files under
their real names, in which every lidar is a user sensor with the same name, site and position in the list of sensors.
The lidar's configuration becomes a custom text, so that the compiled model contains it, also as `.mjb`, in another
process, or attached to another model with a prefix.
"""

import json
import logging
import os
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from html import escape
from typing import Any
from xml.parsers.expat import ExpatError

import mujoco
import numpy as np

from mjplug.errors import ModelError, UnknownName
from mjplug.model import lidar_attributes
from mjplug.model.xml_positions import Edit, Element, edited, parse

PLUGIN = "mujoco.plugin.lidar"
"""The name of the MuJoCo plugin in models."""

_ROOTS = ("mujoco", "mujocoinclude")
"""Root elements of files. The content of an included file may belong to any section."""

_TEXT = re.compile(rf"(.*){re.escape(PLUGIN)}: (.*)", re.DOTALL)
_KEPT = ("name", "objtype", "objname", "noise", "user")
_SITE = "site"

_log = logging.getLogger(__name__)

Read = Callable[[str], bytes | None]
"""Returns the content of a file; None if there is no such file."""


@dataclass(frozen=True, slots=True)
class LidarSensor:
    """A lidar sensor of a model.

    Attributes:
        name: The sensor's name.
        site: Id of the sensor's site.
        attributes: The attributes in the model, by name: integers and floats, or lists of them.
    """

    name: str
    site: int
    attributes: dict[str, Any]


def lidar_sensors(model: mujoco.MjModel) -> dict[str, LidarSensor]:
    """Returns the `mujoco.plugin.lidar` sensors of a compiled model, by name."""
    found: dict[str, LidarSensor] = {}
    for text in range(model.ntext):
        match = _TEXT.fullmatch(mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_TEXT, text) or "")
        if match is None:
            continue
        start = model.text_adr[text]
        data = bytes(model.text_data[start : start + model.text_size[text]]).rstrip(b"\0")
        attributes = json.loads(data)
        # MuJoCo puts the prefix of an attached model before the names of its sensors, sites and texts.
        name, site = match[1] + match[2], match[1] + attributes.pop(_SITE, "")
        for called, sensor in _sensors_called(model, name, site):
            found[called] = LidarSensor(called, int(model.sensor_objid[sensor]), dict(attributes))
    return found


def _sensors_called(model: mujoco.MjModel, name: str, site: str) -> Iterator[tuple[str, int]]:
    """Yields the sensor of a name, or the sensors that `replicate` has made from it."""
    exact = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SENSOR, name)
    if exact >= 0:
        yield name, exact
        return
    for sensor in np.flatnonzero(model.sensor_type == mujoco.mjtSensor.mjSENS_USER).tolist():
        called = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_SENSOR, sensor) or ""
        at = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_SITE, int(model.sensor_objid[sensor])) or ""
        # `replicate` appends the same separator and number to the names of the sensor and of its site.
        if called.startswith(name) and at == site + called.removeprefix(name):
            yield called, sensor


def overlay(path: str, read: Read) -> dict[str, bytes]:
    """Returns the changed files of a model, by name, so that MuJoCo can load them.

    Args:
        path: The model's main file.
        read: Returns the content of a file.

    Raises:
        ModelError: A lidar is invalid, or a file is not XML.
    """
    files = _files(path, read)
    instances = {
        str(instance.attributes.get("name")): instance
        for file in files.values()
        for plugin in _extensions(file.root)
        for instance in plugin.children
    }
    texts: list[str] = []
    for name, file in files.items():
        file.edits += [Edit(plugin.start, plugin.end) for plugin in _extensions(file.root)]
        for sensor in _sensors(file.root, instances):
            where = f"{name}:{sensor.line}"
            replacement, text = _replaced(sensor, where, instances)
            file.edits.append(Edit(sensor.start, sensor.end, replacement))
            texts += text
    main = files[path]
    if texts:
        main.edits.append(Edit(main.root.inner_end, main.root.inner_end, f"<custom>{''.join(texts)}</custom>"))
    changed = {name: edited(file.content, file.edits) for name, file in files.items() if file.edits}
    attached = {_relative_to(path, model) for file in files.values() for model in _referred(file.root, "model")}
    for model in attached - {path}:
        if read(model) is not None:
            changed |= overlay(model, read)
    return changed


@dataclass(slots=True)
class _File:
    content: bytes
    root: Element
    edits: list[Edit]


def _files(main: str, read: Read) -> dict[str, _File]:
    """Returns the main file and its included files, by name. MuJoCo reports missing files."""
    files: dict[str, _File] = {}
    waiting = [main]
    while waiting:
        name = waiting.pop(0)
        content = read(name) if name not in files else None
        if content is None:
            continue
        try:
            root = parse(content)
        except ExpatError as error:
            raise ModelError(f"{name}: {error}") from error
        files[name] = _File(content, root, [])
        # In MuJoCo, all file names are relative to the main file's folder, also in files from other folders.
        waiting += [_relative_to(main, file) for file in _referred(root, "include")]
    return files


def _relative_to(main: str, file: str) -> str:
    return os.path.normpath(os.path.join(os.path.dirname(main), file))


def _referred(root: Element, tag: str) -> list[str]:
    return [e.attributes["file"] for e, _ in root.descendants() if e.tag == tag and "file" in e.attributes]


def _extensions(root: Element) -> Iterator[Element]:
    for element, parent in root.descendants():
        declared = element.tag == "plugin" and element.attributes.get("plugin") == PLUGIN
        if declared and "objname" not in element.attributes and parent.tag in ("extension", *_ROOTS):
            yield element


def _sensors(root: Element, instances: dict[str, Element]) -> Iterator[Element]:
    for element, parent in root.descendants():
        plugin, instance = element.attributes.get("plugin"), element.attributes.get("instance")
        ours = plugin == PLUGIN or (plugin is None and instance in instances)
        sensor = parent.tag == "sensor" or (parent.tag in _ROOTS and "objname" in element.attributes)
        if element.tag == "plugin" and ours and sensor:
            yield element


def _replaced(sensor: Element, where: str, instances: dict[str, Element]) -> tuple[str, list[str]]:
    """Returns the replacements of a lidar in the sensor section and in the custom section."""
    name, instance = sensor.attributes.get("name", ""), sensor.attributes.get("instance")
    where = f"{where}: lidar sensor {name!r}" if name else f"{where}: lidar sensor without a name"
    if sensor.attributes.get("objtype") != "site" or not sensor.attributes.get("objname"):
        raise ModelError(f'{where}: a lidar needs a site; write objtype="site" objname="SITE"')
    if instance is not None and instance not in instances:
        raise ModelError(f"{where}: {UnknownName(f'instance of {PLUGIN}', instance, instances)}")
    configs = (sensor if instance is None else instances[instance]).children
    written = {c.attributes.get("key", ""): c.attributes.get("value", "") for c in configs if c.tag == "config"}
    attributes = lidar_attributes.validated(written, where)
    kept = "".join(f' {key}="{escape(sensor.attributes[key])}"' for key in _KEPT if key in sensor.attributes)
    # One unused number, because MuJoCo processes all numbers of a sensor at every step.
    user = f'<user{kept} dim="1" needstage="acc" datatype="real"/>'
    if not name:
        _log.warning("%s is not published; give it a name", where)
        return user, []
    data = json.dumps({_SITE: sensor.attributes["objname"], **attributes})
    return user, [f'<text name="{escape(f"{PLUGIN}: {name}")}" data="{escape(data)}"/>']
