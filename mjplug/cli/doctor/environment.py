"""Checks Python, packages, plugins and environment variables."""

import os
import platform
import re
from collections.abc import Callable, Iterator, Mapping
from importlib.metadata import PackageNotFoundError, version

from mjplug.cli.doctor.finding import Finding

_TOPIC = "environment"

Version = Callable[[str], str]


def check_environment(environ: Mapping[str, str] = os.environ, installed: Version = version) -> Iterator[Finding]:
    """Yields findings about the installation.

    Args:
        environ: The environment variables.
        installed: Returns the version of a package, as `importlib.metadata.version`.
    """
    cores = os.cpu_count() or 1
    yield Finding(
        _TOPIC,
        "ok",
        f"mjplug {_version('mjplug', installed)} on Python {platform.python_version()}, {platform.system()} "
        f"{platform.release()}, {platform.machine()}, {cores} core{'s' if cores > 1 else ''}",
    )
    if cores == 1:
        yield Finding(
            _TOPIC,
            "warning",
            "the machine has one core: cameras and lidars slow physics down",
            "give the machine or the container a second core",
        )
    yield from _mujoco(installed)
    yield Finding(_TOPIC, "ok", f"eclipse-zenoh {_version('eclipse-zenoh', installed)}")
    yield from _plugins()
    yield from _variables(environ)


def _mujoco(installed: Version) -> Iterator[Finding]:
    found = _version("mujoco", installed)
    numbers = tuple(int(part) for part in re.findall(r"\d+", found)[:3])
    if numbers[:3] == (4, 0, 0):
        yield Finding(
            _TOPIC,
            "error",
            "mujoco 4.0.0 computes wrong forces in large models: its sparse Cholesky factorization is wrong",
            "pip install 'mujoco>=3.13,!=4.0.0,<4.2'",
        )
    elif not (3, 13) <= numbers < (4, 2):
        yield Finding(
            _TOPIC,
            "warning",
            f"mujoco {found} has not been tested with mjplug",
            "pip install 'mujoco>=3.13,!=4.0.0,<4.2'",
        )
    else:
        yield Finding(_TOPIC, "ok", f"mujoco {found}")
    core = _version("mujoco-core", installed)
    if core != "none" and numbers < (4, 0):
        yield Finding(
            _TOPIC,
            "error",
            f"two versions of MuJoCo are installed in one folder: mujoco {found} and mujoco-core {core}",
            "pip uninstall -y mujoco mujoco-core && pip install 'mujoco>=3.13,!=4.0.0,<4.2'",
        )


def _plugins() -> Iterator[Finding]:
    from mjplug.errors import PluginError
    from mjplug.plugin import registry

    points = registry.registered()
    broken = False
    for target in sorted({point.value for point in points.values()}):
        try:
            registry.find(target)
        except PluginError as error:
            broken = True
            yield Finding(
                _TOPIC, "error", str(error), "install the missing package, or uninstall the package of the plugin"
            )
    if not points:
        yield Finding(_TOPIC, "error", "no plugin is registered, not even those of mjplug", "reinstall mjplug with pip")
    elif not broken:
        yield Finding(_TOPIC, "ok", f"{len({point.value for point in points.values()})} plugins can be imported")


def _variables(environ: Mapping[str, str]) -> Iterator[Finding]:
    from mjplug.config.load import read
    from mjplug.config.overrides import PREFIX, RESERVED

    # Any valid configuration: the variables are applied to it.
    for problem in read("bundled:box", environ=environ).problems:
        if problem.severity == "error":
            name = problem.mark.source.name.removeprefix("environment ")
            yield Finding(_TOPIC, "error", str(problem), f"unset {name}")
    own = [name for name in sorted(environ) if name.startswith(PREFIX) and not name.startswith(RESERVED)]
    if own:
        yield Finding(_TOPIC, "note", f"{', '.join(own)}: overrides configuration files")
    middleware = environ.get("RMW_IMPLEMENTATION", "")
    if middleware and middleware != "rmw_zenoh_cpp":
        yield Finding(
            _TOPIC,
            "note",
            f"RMW_IMPLEMENTATION={middleware}: ROS 2 nodes started here do not discover the server",
            "export RMW_IMPLEMENTATION=rmw_zenoh_cpp, or run zenoh-bridge-ros2dds",
        )


def _version(package: str, installed: Version) -> str:
    try:
        return installed(package)
    except PackageNotFoundError:
        return "none"
