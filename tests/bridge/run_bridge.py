"""Runs the bridge like its entry point, and prints at the end the modules imported besides the standard library."""

import atexit
import sys

from mjplug_bridge_ros2.main import main


def tell():
    packages = {name.partition(".")[0] for name in sys.modules}
    print("imported:", *sorted(packages - sys.stdlib_module_names), file=sys.stderr)


atexit.register(tell)
sys.exit(main())
