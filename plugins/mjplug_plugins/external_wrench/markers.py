"""Arrow markers that show active wrenches in RViz."""

from mjplug_plugins.external_wrench.wrench import Vec, Wrench
from mjplug_schemas.geometry_msgs import Point, Vector3
from mjplug_schemas.std_msgs import ColorRGBA, Header
from mjplug_schemas.visualization_msgs import Marker

FORCE = "external_wrench/force"
TORQUE = "external_wrench/torque"

_COLOURS = {FORCE: ColorRGBA(r=1.0, g=0.0, b=0.0, a=0.8), TORQUE: ColorRGBA(r=0.0, g=0.7, b=0.9, a=0.8)}
_SIZE = Vector3(x=0.02, y=0.04, z=0.0)
_MIN_SQUARED_LENGTH = 1e-18


def arrows(wrench: Wrench, frame: str, marker_id: int, force_scale: float, torque_scale: float) -> list[Marker]:
    """Returns a red arrow for the force and a cyan arrow for the torque; a zero vector has no arrow.

    Args:
        wrench: The wrench to show.
        frame: TF frame of the wrench's body.
        marker_id: Id of the markers, the same in both marker namespaces.
        force_scale: Arrow length per force, ramp included [m/N].
        torque_scale: Arrow length per torque, ramp included [m/(N·m)].
    """
    parts = ((FORCE, wrench.force, force_scale), (TORQUE, wrench.torque, torque_scale))
    return [_arrow(ns, wrench, frame, marker_id, vec, scale) for ns, vec, scale in parts if _visible(vec, scale)]


def deletions(wrench: Wrench, frame: str, marker_id: int) -> list[Marker]:
    """Returns the messages that delete a wrench's arrows; `frame` is the TF frame of its body."""
    header = Header(frame_id=frame)
    return [
        Marker(header=header, ns=ns, id=marker_id, type=Marker.ARROW, action=Marker.DELETE)
        for ns, vec in ((FORCE, wrench.force), (TORQUE, wrench.torque))
        if _visible(vec, 1.0)
    ]


def _visible(vec: Vec, scale: float) -> bool:
    return sum(v * v for v in vec) > _MIN_SQUARED_LENGTH and scale > 0.0


def _arrow(ns: str, wrench: Wrench, frame: str, marker_id: int, vec: Vec, scale: float) -> Marker:
    start, tip = wrench.point, [p + scale * v for p, v in zip(wrench.point, vec, strict=True)]
    return Marker(
        # A zero stamp asks RViz for the newest transform, so the arrow stays on the body.
        header=Header(frame_id=frame),
        ns=ns,
        id=marker_id,
        type=Marker.ARROW,
        action=Marker.ADD,
        points=[Point(x=start[0], y=start[1], z=start[2]), Point(x=tip[0], y=tip[1], z=tip[2])],
        scale=_SIZE,
        color=_COLOURS[ns],
    )
