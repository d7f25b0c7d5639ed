"""Programs of a user, in separate processes."""

import subprocess
import sys
import textwrap

from cli.process import environment


def run_script(text, tmp_path, *options):
    """Runs a program, in which warnings are errors."""
    script = tmp_path / "script.py"
    script.write_text(textwrap.dedent(text))
    return subprocess.run(
        [sys.executable, "-W", "error", *options, str(script)],
        capture_output=True, text=True, timeout=120.0, check=False, cwd=tmp_path, env=environment(),
    )  # fmt: skip
