"""A first configuration file for a model."""

import textwrap
from collections.abc import Iterator

import mujoco
from pydantic import BaseModel

from mjplug.cli.yaml_text import scalar, text
from mjplug.config.settings import Settings

_WIDTH = 100


def starting_file(uri: str, model: mujoco.MjModel) -> str:
    """Returns a file for a model: settings with their defaults, commented out, and plugins that fit the model.

    Args:
        uri: The model, as written in the file.
        model: The model.
    """
    lines = [
        "# Configuration of mjplug. Lines that are commented out are defaults; `mjplug config show` shows all values.",
        f"model: {text(uri)}",
        "",
    ]
    for name, field in Settings.model_fields.items():
        if name in ("model", "plugins"):
            continue
        if isinstance(field.default, BaseModel):
            lines += [f"# {field.description}", f"# {name}:", *_section(field.default, model), ""]
        else:
            lines += [*_comment(field.description, ""), f"# {name}: {scalar(field.default)}", ""]
    lines += ["# `mjplug plugin list` lists the plugins, `mjplug plugin info TYPE` shows their parameters.", "plugins:"]
    lines += [f"  {name}: {{type: {name}}}" for name in _useful(model)]
    return "\n".join(lines)


def _section(section: BaseModel, model: mujoco.MjModel) -> Iterator[str]:
    for name, field in type(section).model_fields.items():
        yield from _comment(field.description, "  ")
        if name == "keyframe" and model.nkey:
            names = (model.key(i).name or str(i) for i in range(model.nkey))
            yield f"#   # The model has: {', '.join(names)}."
        yield f"#   {name}: {scalar(field.default)}"


def _comment(description: str | None, indent: str) -> Iterator[str]:
    """Yields a description as a comment that remains a comment when the user uncomments the section."""
    mark = f"#{indent and ' '}{indent}# " if indent else "# "
    for line in textwrap.wrap(description or "", _WIDTH):
        yield f"{mark}{line}"


def _useful(model: mujoco.MjModel) -> Iterator[str]:
    yield "heartbeat"
    yield "external_wrench"
    if any(model.jnt_type == mujoco.mjtJoint.mjJNT_FREE):
        yield "free_joint_state_publisher"
