"""Runs the example: its script opens the server itself."""

import subprocess
import sys
from pathlib import Path

print("$ python examples/12_in_one_program/throw.py", flush=True)
sys.exit(subprocess.run([sys.executable, Path(__file__).with_name("throw.py")], check=False).returncode)
