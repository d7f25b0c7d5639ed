"""Reads a URDF or xacro file as XML. A xacro file is expanded without ROS."""

import contextlib
import io
import re
import sys
import threading
import types
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from mjplug.convert.extras import required
from mjplug.errors import ModelError, did_you_mean
from mjplug.model.packages import Packages

_XACRO_PREFIX, _XACRO_TAG = b"xmlns:xacro", b"<xacro:"
_FIND = "ament_index_python.packages"

_lock = threading.Lock()
"""xacro keeps its state in globals."""


@dataclass(slots=True)
class Source:
    """The expanded file.

    Attributes:
        path: The file.
        root: Its `<robot>`.
        warnings: Warnings of xacro, and about the file.
        origin: What it is, if it does not come from a file of the user; then it can only name files in ROS packages.
    """

    path: Path
    root: Element
    warnings: list[str] = field(default_factory=list)
    origin: str = ""


def read_source(path: Path, arguments: Mapping[str, str], packages: Packages) -> Source:
    """Reads a URDF, or expands a xacro file.

    xacro evaluates the Python expressions of a file. It runs only if the name ends with `.xacro`, or if the file
    declares the namespace `xacro` and contains an element of it.

    Args:
        path: The file.
        arguments: xacro arguments (`name:=value`).
        packages: Packages for `$(find ...)`.

    Raises:
        ModelError: The file is not XML or not a robot, an argument is missing or unknown, or xacro reports an error.
    """
    try:
        text = path.read_bytes()
    except OSError as error:
        raise ModelError(f"{path} cannot be read: {error.strerror}") from error
    uses_xacro = path.suffix.lower() == ".xacro" or (_XACRO_PREFIX in text and _XACRO_TAG in text)
    if uses_xacro:
        source = _expanded(path, text, arguments, packages)
    else:
        if arguments:
            names = ", ".join(arguments)
            raise ModelError(f"{path} does not use xacro, so it has no arguments; these were given: {names}")
        source = Source(path, _parsed(path, text))
    if not uses_xacro and any("${" in link.get("name", "") for link in source.root.iterfind("link")):
        source.warnings.append("names contain ${...}, which a launch file usually replaces")
    if source.root.tag != "robot":
        raise ModelError(f"{path} is not a robot description: its root element is <{source.root.tag}>, not <robot>")
    if source.root.find("link") is None:
        macros = re.findall(rb"<xacro:macro\b[^>]*?\bname\s*=\s*[\"']([^\"']+)", text)
        if macros:
            names = ", ".join(name.decode(errors="replace") for name in macros[:5])
            raise ModelError(
                f"{path} contains no link; it only defines macros ({names}). Convert the file that calls them, or a "
                "file of your own that includes this one and calls one of them"
            )
        raise ModelError(f"{path} contains no link")
    return source


def _parsed(path: Path, text: bytes) -> Element:
    try:
        return ElementTree.fromstring(text)
    except (ElementTree.ParseError, LookupError, ValueError) as error:
        raise ModelError(f"{path} is not valid XML: {error}") from error


def _expanded(path: Path, text: bytes, arguments: Mapping[str, str], packages: Packages) -> Source:
    xacro = required("xacro", f"the xacro file {path.name}")
    _check_arguments(path, text, arguments)
    messages = io.StringIO()
    with _lock, _packages_for_xacro(packages), contextlib.redirect_stderr(messages):
        try:
            document = xacro.process_file(str(path), mappings=dict(arguments))
            expanded = document.toxml()
        except ModelError:
            raise
        except Exception as error:  # xacro raises many kinds, also those of evaluated expressions
            raise ModelError(f"{path}: {_reason(error, text)}") from error
    warnings = [_plain(line) for line in messages.getvalue().splitlines() if line.strip()]
    return Source(path, _parsed(path, expanded.encode()), warnings)


def _check_arguments(path: Path, text: bytes, arguments: Mapping[str, str]) -> None:
    """Refuses an argument that the file does not have; xacro would ignore it.

    Only if the file includes no other file, whose arguments are not known before the expansion.
    """
    declared = _declared(text)
    if b"xacro:include" in text:
        return
    for name in arguments:
        if name not in declared:
            known = f"; its arguments are {', '.join(declared)}" if declared else "; it has no arguments"
            raise ModelError(f"{path} has no argument {name!r}{did_you_mean(name, declared)}{known}")


def _declared(text: bytes) -> list[str]:
    """Returns the arguments that a file declares or uses."""
    found = re.findall(rb"<xacro:arg\b[^>]*?\bname\s*=\s*[\"']([^\"']+)", text) + re.findall(
        rb"\$\(arg +([^)\s]+) *\)", text
    )
    return list(dict.fromkeys(name.decode(errors="replace") for name in found))


def _reason(error: Exception, text: bytes) -> str:
    inner = error
    while isinstance(getattr(inner, "exc", None), Exception):
        inner = inner.exc  # type: ignore[attr-defined]
    if isinstance(inner, ModelError):
        return str(inner)
    if isinstance(inner, OSError) and inner.filename:
        names = ", ".join(_declared(text))
        listing = f" (arguments of this file: {names})" if names else ""
        return f"xacro: there is no file {inner.filename}{listing}"
    if type(inner).__name__ == "ArgException" or "Undefined substitution argument" in str(error):
        name = str(inner.args[0]).rpartition(" ")[2] if inner.args else "?"
        declared = _declared(text)
        listing = f" (arguments of this file: {', '.join(declared)})" if declared else ""
        return f"xacro needs a value for the argument {name!r}; add {name}:=VALUE{listing}"
    message = _plain(" ".join(str(error).split()))
    return f"xacro: {message or type(inner).__name__}"


def _plain(line: str) -> str:
    return re.sub(r"\x1b\[[0-9;]*m", "", line).strip()


@contextlib.contextmanager
def _packages_for_xacro(packages: Packages) -> Iterator[None]:
    """Lets `$(find pkg)` use our search for packages: xacro imports the function from ROS's `ament_index_python`."""

    def get_package_share_directory(name: str) -> str:
        folder = next(packages.folders(name), None)
        if folder is None:
            raise ModelError(
                f"$(find {name}): there is no package {name!r} in {packages.searched()}; give its folder: "
                f"--package {name}=FOLDER"
            )
        return str(folder)

    modules: dict[str, types.ModuleType | None] = {}
    for name in (_FIND.partition(".")[0], _FIND):
        modules[name] = sys.modules.get(name)
        stub = types.ModuleType(name)
        stub.__dict__["get_package_share_directory"] = get_package_share_directory
        sys.modules[name] = stub
    sys.modules[_FIND.partition(".")[0]].__dict__["packages"] = sys.modules[_FIND]
    try:
        yield
    finally:
        for name, module in modules.items():
            if module is None:
                del sys.modules[name]
            else:
                sys.modules[name] = module
