"""Runs the command line for `python -m mjplug`."""

from mjplug.cli import main

main()
