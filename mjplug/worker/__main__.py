"""Runs a worker process for `python -m mjplug.worker`. Only the server starts it."""

from mjplug.worker.child import main

main()
