"""`python -m mjplug` is the command line."""

from mjplug.cli import main

main()
