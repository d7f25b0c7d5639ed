"""`python -m mjplug.worker`: a worker process; only the server starts it."""

from mjplug.worker.child import main

main()
