"""Runs the example: its tests open the server themselves."""

import subprocess
import sys
from pathlib import Path

folder = Path(__file__).parent
print(f"{folder.name}$ python -m pytest -q test_controller.py", flush=True)
command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "test_controller.py"]
sys.exit(subprocess.run(command, cwd=folder, check=False).returncode)
