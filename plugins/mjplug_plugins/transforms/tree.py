"""The tree of frames: the parent of each frame, and whether the frame moves relative to it."""

from dataclasses import dataclass

import mujoco

from mjplug.plugin import Host, PluginError
from mjplug_plugins.transforms.frame import (
    IDENTITY_QUAT,
    ZERO_POSITION,
    Frame,
    camera_frames,
    configured_frame,
    site_frames,
)
from mjplug_plugins.transforms.parameters import TransformsParameters

_WORLD = 0


@dataclass(frozen=True, slots=True)
class Link:
    """A frame and its parent.

    Attributes:
        frame: The frame.
        parent: Id of the parent body.
        parent_name: Name of the parent frame.
        rigid: Whether the frame never moves relative to its parent.
    """

    frame: Frame
    parent: int
    parent_name: str
    rigid: bool


def links(host: Host, parameters: TransformsParameters) -> list[Link]:
    """Returns the links to publish.

    Raises:
        UnknownName: The model has no object of a configured name.
        PluginError: Two frames have the same name.
    """
    bodies = _bodies(host, parameters)
    roots = {host.body_id(name) for name in parameters.roots}
    names = {**bodies, _WORLD: parameters.world_frame}
    if parameters.world_frame in bodies.values():
        raise PluginError(
            f"body {parameters.world_frame!r} has the same name as the world frame; set world_frame to another name"
        )
    result = [
        _link(host.model, Frame(name, body, ZERO_POSITION, IDENTITY_QUAT), names) for body, name in bodies.items()
    ]
    result = [link for link in result if link.frame.body not in roots]
    frames = {name: Frame(name, body, ZERO_POSITION, IDENTITY_QUAT) for body, name in names.items()}
    for frame in _other_frames(host, parameters):
        if frame.name not in frames:
            result.append(_link(host.model, frame, names))
        elif frame.name in parameters.frames:
            raise PluginError(f"frames: another frame is already called {frame.name!r}; choose another name")
        elif not frames[frame.name].coincides_with(frame):
            host.logger.warning(
                "two frames would be called %r: a site has the same name as a body, a camera frame or another site. "
                "The site is not published; add it to `frames` under another name",
                frame.name,
            )
        frames.setdefault(frame.name, frame)
    return result


def _bodies(host: Host, parameters: TransformsParameters) -> dict[int, str]:
    """Returns the names of the bodies to publish, by body id."""
    model = host.model
    excluded = {host.body_id(name) for name in parameters.exclude}
    chosen = [host.body_id(name) for name in parameters.bodies] or range(1, model.nbody)
    named = {body: mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_BODY, body) or "" for body in sorted(chosen)}
    return {body: name for body, name in named.items() if name and body != _WORLD and body not in excluded}


def _other_frames(host: Host, parameters: TransformsParameters) -> list[Frame]:
    cameras = camera_frames(host.model) if parameters.cameras else ()
    configured = (configured_frame(host.model, name, frame) for name, frame in parameters.frames.items())
    return [*cameras, *site_frames(host.model, parameters), *configured]


def _link(model: mujoco.MjModel, frame: Frame, names: dict[int, str]) -> Link:
    """Links a frame to the nearest ancestor body that is published."""
    body = frame.body
    rigid = frame.camera is None
    is_body_itself = names.get(body) == frame.name
    while is_body_itself or body not in names:
        rigid = rigid and not model.body_dofnum[body] and model.body_mocapid[body] < 0
        body, is_body_itself = int(model.body_parentid[body]), False
    return Link(frame, body, names[body], bool(rigid))
