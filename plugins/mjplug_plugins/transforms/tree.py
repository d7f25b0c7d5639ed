"""Which frame hangs on which, and which of them move against each other."""

from dataclasses import dataclass

import mujoco

from mjplug.plugin import Host, PluginError
from mjplug_plugins.transforms.frame import HERE, UNTURNED, Frame, camera_frames, given_frame, site_frames
from mjplug_plugins.transforms.parameters import TransformsParameters

_WORLD = 0


@dataclass(frozen=True, slots=True)
class Link:
    """A frame in its parent.

    Attributes:
        frame: The frame.
        parent: The id of the body that is its parent.
        parent_name: The parent's frame.
        rigid: Whether it never moves in its parent.
    """

    frame: Frame
    parent: int
    parent_name: str
    rigid: bool


def links(host: Host, parameters: TransformsParameters) -> list[Link]:
    """Returns the links to publish.

    Raises:
        UnknownName: The model lacks something that is configured.
        PluginError: Two frames have one name.
    """
    bodies = _bodies(host, parameters)
    roots = {host.body_id(name) for name in parameters.roots}
    names = {**bodies, _WORLD: parameters.world_frame}
    if parameters.world_frame in bodies.values():
        raise PluginError(f"body {parameters.world_frame!r} has the name of the world's frame; set world_frame")
    found = [_link(host.model, Frame(name, body, HERE, UNTURNED), names) for body, name in bodies.items()]
    found = [link for link in found if link.frame.body not in roots]
    taken = {name: Frame(name, body, HERE, UNTURNED) for body, name in names.items()}
    for frame in _other_frames(host, parameters):
        if frame.name not in taken:
            found.append(_link(host.model, frame, names))
        elif frame.name in parameters.frames:
            raise PluginError(f"frames: {frame.name!r} is the name of another frame already")
        elif not taken[frame.name].is_at(frame):
            host.logger.warning(
                "two frames would be called %r: a site has the name of a body, a camera's or another site's frame, and "
                "is not published; frames can give it another name",
                frame.name,
            )
        taken.setdefault(frame.name, frame)
    return found


def _bodies(host: Host, parameters: TransformsParameters) -> dict[int, str]:
    """Returns the bodies that are frames, by their ids."""
    model = host.model
    left_out = {host.body_id(name) for name in parameters.exclude}
    chosen = [host.body_id(name) for name in parameters.bodies] or range(1, model.nbody)
    named = {body: mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_BODY, body) or "" for body in sorted(chosen)}
    return {body: name for body, name in named.items() if name and body != _WORLD and body not in left_out}


def _other_frames(host: Host, parameters: TransformsParameters) -> list[Frame]:
    cameras = camera_frames(host.model) if parameters.cameras else ()
    given = (given_frame(host.model, name, frame) for name, frame in parameters.frames.items())
    return [*cameras, *site_frames(host.model, parameters), *given]


def _link(model: mujoco.MjModel, frame: Frame, names: dict[int, str]) -> Link:
    """Hangs a frame on the nearest body above it that is a frame."""
    body = frame.body
    rigid = frame.camera is None
    is_body_itself = names.get(body) == frame.name
    while is_body_itself or body not in names:
        rigid = rigid and not model.body_dofnum[body] and model.body_mocapid[body] < 0
        body, is_body_itself = int(model.body_parentid[body]), False
    return Link(frame, body, names[body], bool(rigid))
