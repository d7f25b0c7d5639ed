"""Lets models load that use `mujoco.plugin.lidar`, mujoco_ros2_control's sensor that MuJoCo itself does not have.

MuJoCo refuses such a model while it parses, so its text has to change: in copies of its files that MuJoCo finds in
memory under the names of the real ones, every lidar becomes a user sensor of the same name, at the same site and the
same place in the list. Its configuration becomes a custom text, so that the compiled model has all there is to know,
also as `.mjb`, in another process, or attached to another model under a prefix.
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
"""The name that models know it by."""

_ROOTS = ("mujoco", "mujocoinclude")
"""Roots of files. What an included file has stands where it is included, so its root may stand for any section."""

_TEXT = re.compile(rf"(.*){re.escape(PLUGIN)}: (.*)", re.DOTALL)
_KEPT = ("name", "objtype", "objname", "noise", "user")
_SITE = "site"

_log = logging.getLogger(__name__)

Read = Callable[[str], bytes | None]
"""Returns what a file has, None if there is no such file."""


@dataclass(frozen=True, slots=True)
class LidarSensor:
    """A lidar that the model describes.

    Attributes:
        name: The sensor's name.
        site: The id of the site that it is at.
        attributes: Those that the model gives, by their names in the model: whole numbers and numbers, alone or in
            lists.
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
        # MuJoCo puts the prefix of an attached model before the names of sensor, site and text alike.
        name, site = match[1] + match[2], match[1] + attributes.pop(_SITE, "")
        for called, sensor in _sensors_called(model, name, site):
            found[called] = LidarSensor(called, int(model.sensor_objid[sensor]), dict(attributes))
    return found


def _sensors_called(model: mujoco.MjModel, name: str, site: str) -> Iterator[tuple[str, int]]:
    """Yields the sensor of a name, or those that `replicate` has made of it, as it has made more of its site."""
    exact = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SENSOR, name)
    if exact >= 0:
        yield name, exact
        return
    for sensor in np.flatnonzero(model.sensor_type == mujoco.mjtSensor.mjSENS_USER).tolist():
        called = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_SENSOR, sensor) or ""
        at = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_SITE, int(model.sensor_objid[sensor])) or ""
        # Both get the same number, with a separator before it that may be anything.
        if called.startswith(name) and at == site + called.removeprefix(name):
            yield called, sensor


def overlay(path: str, read: Read) -> dict[str, bytes]:
    """Returns the files of a model that have to be other than they are, by name, as MuJoCo can read them.

    Args:
        path: The model's main file.
        read: Returns the content of a file.

    Raises:
        ModelError: A lidar is described wrongly, or a file is no XML.
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
    attached = {_beside(path, model) for file in files.values() for model in _referred(file.root, "model")}
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
    """Returns the main file and those that it includes, by name; one that is not there is left to MuJoCo."""
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
        # MuJoCo counts from the main file's folder also in a file that is included from another folder.
        waiting += [_beside(main, file) for file in _referred(root, "include")]
    return files


def _beside(main: str, file: str) -> str:
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
    """Returns what stands for a lidar in the sensor section, and in the custom section."""
    name, instance = sensor.attributes.get("name", ""), sensor.attributes.get("instance")
    where = f"{where}: lidar sensor {name!r}" if name else f"{where}: lidar sensor without a name"
    if sensor.attributes.get("objtype") != "site" or not sensor.attributes.get("objname"):
        raise ModelError(f'{where}: it must be at a site, with objtype="site" and the name of the site as objname')
    if instance is not None and instance not in instances:
        raise ModelError(f"{where}: {UnknownName(f'instance of {PLUGIN}', instance, instances)}")
    configs = (sensor if instance is None else instances[instance]).children
    written = {c.attributes.get("key", ""): c.attributes.get("value", "") for c in configs if c.tag == "config"}
    attributes = lidar_attributes.validated(written, where)
    kept = "".join(f' {key}="{escape(sensor.attributes[key])}"' for key in _KEPT if key in sensor.attributes)
    # One number, which nobody writes: MuJoCo goes over all numbers of a sensor at every step.
    user = f'<user{kept} dim="1" needstage="acc" datatype="real"/>'
    if not name:
        _log.warning("%s is not published", where)
        return user, []
    data = json.dumps({_SITE: sensor.attributes["objname"], **attributes})
    return user, [f'<text name="{escape(f"{PLUGIN}: {name}")}" data="{escape(data)}"/>']
