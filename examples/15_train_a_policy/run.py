"""Runs the example: its script opens the server itself."""

import subprocess
import sys
from pathlib import Path

print("$ python examples/15_train_a_policy/train.py", flush=True)
sys.exit(subprocess.run([sys.executable, Path(__file__).with_name("train.py")], check=False).returncode)
