"""Runs the tests under each Python that pyproject.toml names, one after the other: `make test-all`.

An interpreter is taken from the machine (PATH and pyenv), else downloaded by uv. One that cannot be had is named at the
end, and is no error. The environments are kept in build/.
"""

import os
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
TARGET = sys.argv[1:] or ["test"]
"""What to make in each environment, such as `test TESTS=tests/schemas`."""


def main() -> int:
    """Returns 1 if a test failed, or if no Python was found."""
    versions = re.findall(r'"Programming Language :: Python :: (3\.\d+)"', (ROOT / "pyproject.toml").read_text("utf-8"))
    results = {version: run(version) for version in versions}
    print("\nmake test-all:")
    for version, result in results.items():
        print(f"  Python {version}: {result}")
    failed = any(result == "FAILED" for result in results.values())
    return 1 if failed or all(result.startswith("not run") for result in results.values()) else 0


def run(version: str) -> str:
    """Runs the tests under a version of Python; returns the result for the list at the end."""
    python, reason = find(version)
    if python is None:
        return f"not run: {reason}"
    print(f"\n=== Python {version}: {python}", flush=True)
    environment = {name: value for name, value in os.environ.items() if name not in ("MAKEFLAGS", "MAKELEVEL")}
    command = ["make", *TARGET, f"VENV=build/python-{version}", f"PYTHON={python}"]
    done = subprocess.run(command, cwd=ROOT, env=environment, check=False)
    return "passed" if done.returncode == 0 else "FAILED"


def find(version: str) -> tuple[str | None, str]:
    """Returns the path of an interpreter, and if there is none, the reason."""
    # What stands in pyenv's shims for a version that is not selected there fails.
    pyenv = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv"), "versions")
    folders = [str(folder) for folder in sorted(pyenv.glob(f"{version}.*/bin"))]
    environment = os.environ | {"PATH": os.pathsep.join([*folders, os.environ["PATH"]])}
    finding = ["uv", "python", "find", "--system", "--no-project", version]
    found = subprocess.run(finding, env=environment, capture_output=True, text=True, check=False)
    if found.returncode != 0:
        # The Makefile forbids downloads, since no other target needs one.
        environment["UV_PYTHON_DOWNLOADS"] = "manual"
        install = ["uv", "python", "install", version]
        installed = subprocess.run(install, env=environment, capture_output=True, text=True, check=False)
        if installed.returncode != 0:
            reason = installed.stderr.strip().partition("\n")[0].removeprefix("error: ")
            return None, f"it is not on this machine, and uv cannot download it ({reason})"
        found = subprocess.run(finding, env=environment, capture_output=True, text=True, check=False)
    return (found.stdout.strip(), "") if found.returncode == 0 else (None, found.stderr.strip())


if __name__ == "__main__":
    sys.exit(main())
