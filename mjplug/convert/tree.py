"""Checks the tree of a robot: one root, one parent for each link, and mimic joints that lead somewhere."""

from collections.abc import Sequence

from mjplug.convert.report import Report
from mjplug.convert.robot import SCALAR, Robot
from mjplug.errors import ModelError, did_you_mean

MAX_DEPTH = 300
"""Largest number of links between the root and a link; the elements of an MJCF are nested as deeply."""


def check_tree(robot: Robot) -> None:
    """Checks that each link has one parent, that all hang on one root, and that no chain of links is too long.

    Raises:
        ModelError: A link has several parents, there are several roots, joints form a loop, or a chain is too long.
    """
    above: dict[str, str] = {}
    for joint in robot.joints.values():
        if joint.child in above:
            raise ModelError(
                f"link {joint.child!r} is the child of joints {above[joint.child]!r} and {joint.name!r}; the links "
                "of a URDF are a tree"
            )
        above[joint.child] = joint.name
    roots = [name for name in robot.links if name not in above]
    if len(roots) > 1:
        raise ModelError(f"several links have no parent: {_listed(roots)}; connect them with joints to one root")
    reached = set(roots) | ({joint.child for joint in robot.walk(roots[0])} if roots else set())
    left = [name for name in robot.links if name not in reached]
    if left:
        raise ModelError(f"the joints of these links form a loop: {_listed(left)}; the links of a URDF are a tree")
    depth = {roots[0]: 0}
    for joint in robot.walk(roots[0]):
        depth[joint.child] = depth[joint.parent] + 1
        if depth[joint.child] > MAX_DEPTH:
            raise ModelError(f"link {joint.child!r} is below more than {MAX_DEPTH} others, which is not supported")


def check_mimics(robot: Robot, report: Report) -> None:
    """Checks that each mimic joint follows a joint with one coordinate.

    A mimic of a joint that does not exist is removed, which the report says.

    Raises:
        ModelError: A joint follows itself, or a joint of another type.
    """
    for joint in robot.joints.values():
        if joint.mimic is None:
            continue
        if joint.type not in SCALAR:
            report.add("loss", "mimic of a joint that does not have one coordinate", joint.name, joint.type)
            joint.mimic = None
            continue
        seen, leader = {joint.name}, joint
        while leader.mimic is not None:
            name = leader.mimic.joint
            if name not in robot.joints:
                near = did_you_mean(name, robot.joints)
                report.add(
                    "warning",
                    "mimic of a joint that does not exist; the joint moves freely",
                    leader.name,
                    f"{name}{near}",
                )
                leader.mimic = None
                break
            if name in seen:
                raise ModelError(f"joint {joint.name!r} mimics itself, through {name!r}")
            seen.add(name)
            leader = robot.joints[name]
        if leader.type not in SCALAR:
            raise ModelError(f"joint {joint.name!r} mimics {leader.name!r}, which has the type {leader.type!r}")


def _listed(names: Sequence[str]) -> str:
    shown = ", ".join(map(repr, names[:5]))
    return f"{shown} and {len(names) - 5} more" if len(names) > 5 else shown
