"""Start and stop of the server's process: readiness, signals, the watchdog that bounds a stop."""
