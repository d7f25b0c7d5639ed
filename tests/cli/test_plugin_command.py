"""`mjplug plugin list` and `mjplug plugin info`: what they show can be copied into a configuration file."""

import textwrap
from collections.abc import Sequence
from typing import Annotated, Literal

import pytest
from pydantic import Field

from mjplug.cli import plugin as command
from mjplug.cli.plugin_page import _named_below
from mjplug.config.load import read
from mjplug.plugin import Parameters, Plugin, registry
from mjplug.plugin.selection import select

TYPES = sorted(name for name in registry.registered() if "/" not in name)

REQUIRED = {
    "body": "base_link",
    "frame_name": "somewhere",
    "site": "eye",
    "min_angle": 0.0,
    "max_angle": 1.0,
    "angle_increment": 0.5,
}
"""What a user would put in place of the dots."""


class ChildParameters(Parameters):
    """Parameters of one child."""

    weight: float = Field(description="How heavy it is [kg].")


class ParentParameters(Parameters, extra="allow"):
    """Parameters of the parent."""

    __pydantic_extra__: dict[str, ChildParameters]

    names: tuple[str, ...] = Field(default=(), description="Names.")
    corner: tuple[float, float] = Field(default=(0.5, 1.0), description="A corner [m].")
    limit: float = Field(default=float("inf"), description="A limit [m].")
    mode: Literal["slow", "fast"] = Field(default="slow", description="A mode.")
    label: str | None = Field(default=None, description="A label.")
    count: Annotated[int, Field(ge=0)] = Field(default=3, description="A count.")


class Parent(Plugin[ParentParameters]):
    """Has children."""

    def init(self, host, parameters):
        pass


def shown(capsys, name):
    command.info(name)
    return capsys.readouterr().out


def test_types_and_defaults_are_those_of_a_configuration_file(capsys):
    text = shown(capsys, f"{__name__}:Parent")
    assert text.partition("Parameters:\n")[2] == (
        """\
  names (list of string, default [])
      Names.
  corner (list of 2 times number, default [0.5, 1.0])
      A corner [m].
  limit (number, default .inf)
      A limit [m].
  mode (slow | fast, default "slow")
      A mode.
  label (string, optional)
      A label.
  count (integer, default 3)
      A count.
  <name> (any number of them): Parameters of one child.
    weight (number, required)
        How heavy it is [kg].

In a configuration file:

  plugins:
    parent:
      type: MODULE:Parent
      names: []
      corner: [0.5, 1.0]
      limit: .inf
      mode: "slow"
      count: 3
      <name>:
        weight: ...
""".replace("MODULE", __name__)
    )


def parameter_names(parameters) -> Sequence[str]:
    below = _named_below(parameters)
    return [*parameters.model_fields, *(below.model_fields if below else [])]


@pytest.mark.parametrize("name", TYPES)
def test_every_parameter_is_shown_with_its_description(capsys, name):
    text = shown(capsys, name)
    for parameter in parameter_names(registry.find(name).parameters_type):
        assert f"  {parameter} (" in text


@pytest.mark.parametrize("name", TYPES)
def test_what_is_shown_loads_when_the_dots_are_filled_in(capsys, tmp_path, name):
    example = shown(capsys, name).partition("In a configuration file:\n\n")[2].replace("<name>", "front")
    lines = []
    for line in example.splitlines():
        key, _, value = line.partition(":")
        lines.append(f"{key}: {REQUIRED[key.strip()]}" if value == " ..." else line)
    (tmp_path / "c.yaml").write_text("model: bundled:mobile_base\n" + textwrap.dedent("\n".join(lines)))
    _, (selected,) = select(read(tmp_path / "c.yaml", environ={}))
    assert selected.plugin_class is registry.find(name)


def test_the_columns_of_the_list_are_aligned_for_all_names(capsys):
    command.list_plugins()
    lines = capsys.readouterr().out.splitlines()
    column = max(map(len, TYPES)) + 2
    assert len(lines) == 2 * len(TYPES)
    for heading, target in zip(lines[::2], lines[1::2], strict=True):
        assert heading[column - 1] == " " != heading[column]
        assert target[:column].isspace()
        assert not target[column].isspace()
    assert {line.split()[0] for line in lines[::2]} == set(TYPES)
