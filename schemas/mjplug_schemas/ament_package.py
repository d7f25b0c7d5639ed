"""Writes a ROS package with message, service and action definitions, for `colcon build`."""

from collections.abc import Iterable, Iterator, Mapping
from html import escape

from mjplug_schemas.action import Action
from mjplug_schemas.definition import definition
from mjplug_schemas.errors import DefinitionError
from mjplug_schemas.idl import Primitive
from mjplug_schemas.message import Message, Service
from mjplug_schemas.shape import fields

Interface = type[Message] | type[Service] | type[Action]

_PACKAGE = """\
<?xml version="1.0"?>
<?xml-model href="http://download.ros.org/schema/package_format3.xsd" schematypens="http://www.w3.org/2001/XMLSchema"?>
<package format="3">
  <name>{name}</name>
  <version>{version}</version>
  <description>{description}</description>
  <maintainer email="{email}">{maintainer}</maintainer>
  <license>{license}</license>

  <buildtool_depend>ament_cmake</buildtool_depend>
  <buildtool_depend>rosidl_default_generators</buildtool_depend>
{depends}  <exec_depend>rosidl_default_runtime</exec_depend>
  <member_of_group>rosidl_interface_packages</member_of_group>

  <export>
    <build_type>ament_cmake</build_type>
  </export>
</package>
"""

_CMAKE = """\
cmake_minimum_required(VERSION 3.8)
project({name})

find_package(ament_cmake REQUIRED)
find_package(rosidl_default_generators REQUIRED)
{finds}
rosidl_generate_interfaces(${{PROJECT_NAME}}
{files}{dependencies})

ament_export_dependencies(rosidl_default_runtime)
ament_package()
"""


def ament_package(
    interfaces: Iterable[Interface],
    version: str,
    description: str,
    maintainer: tuple[str, str],
    license: str = "Apache-2.0",
) -> Mapping[str, str]:
    """Returns the files of an ament_cmake package that contains all messages, services and actions of one ROS package.

    Args:
        interfaces: The messages, services and actions.
        version: Version of the package, such as `1.2.3`.
        description: What the package contains, in one sentence.
        maintainer: Name and email address of the maintainer.
        license: Licence, as an SPDX identifier.

    Returns:
        The texts by relative paths: `package.xml`, `CMakeLists.txt`, `msg/*.msg`, `srv/*.srv` and `action/*.action`.

    Raises:
        DefinitionError: There are no interfaces, or they belong to several packages.
    """
    types = {interface.TYPE: interface for interface in interfaces}
    names = sorted({type_name.partition("/")[0] for type_name in types})
    if len(names) != 1:
        raise DefinitionError(f"the interfaces belong to the packages {names}; give those of one package")
    (name,) = names
    texts = {_path(type_name): definition(types[type_name]) for type_name in sorted(types)}
    used = sorted({package for interface in types.values() for package in _packages(interface)} - {name})
    return {
        "package.xml": _PACKAGE.format(
            name=name,
            version=escape(version),
            description=escape(description),
            maintainer=escape(maintainer[0]),
            email=escape(maintainer[1]),
            license=escape(license),
            depends="".join(f"  <depend>{package}</depend>\n" for package in used),
        ),
        "CMakeLists.txt": _CMAKE.format(
            name=name,
            finds="".join(f"find_package({package} REQUIRED)\n" for package in used),
            files="".join(f'  "{path}"\n' for path in texts),
            dependencies=f"  DEPENDENCIES {' '.join(used)}\n" if used else "",
        ),
        **texts,
    }


def _path(type_name: str) -> str:
    _, kind, name = type_name.split("/")
    return f"{kind}/{name}.{kind}"


def _packages(interface: Interface) -> Iterator[str]:
    """Yields the packages of the messages that the fields contain."""
    parts: tuple[type[Message], ...]
    if issubclass(interface, Service):
        parts = (interface.Request, interface.Response)
    elif issubclass(interface, Action):
        parts = (interface.Goal, interface.Result, interface.Feedback)
    else:
        parts = (interface,)
    for part in parts:
        for field in fields(part):
            if not isinstance(field.element, Primitive):
                yield str(getattr(field.element, "TYPE", "")).partition("/")[0]
