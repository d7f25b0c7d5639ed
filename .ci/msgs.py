"""Writes the ROS package mjplug_msgs into msgs_ros2/ from mjplug_schemas: `make msgs`."""

import shutil
import tomllib
from pathlib import Path

from mjplug_schemas.ament_package import ament_package
from mjplug_schemas.registry import all_types

ROOT = Path(__file__).parents[1]
FOLDER = ROOT / "msgs_ros2"


def files() -> dict[str, str]:
    """Returns the texts of the package's files by their relative paths."""
    version = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]["version"]
    return dict(
        ament_package(
            (interface for name, interface in all_types().items() if name.startswith("mjplug_msgs/")),
            version,
            "Messages and services of an mjplug simulation server: saved states, and steps in one request.",
            ("mjplug maintainers", "maintainers@mjplug.invalid"),
        )
    )


def main() -> None:
    """Replaces the folder."""
    shutil.rmtree(FOLDER, ignore_errors=True)
    for name, text in files().items():
        path = FOLDER / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, "utf-8")
    print(f"wrote {FOLDER.relative_to(ROOT)}")


if __name__ == "__main__":
    main()
