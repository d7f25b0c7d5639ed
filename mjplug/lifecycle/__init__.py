"""Start and stop of the process of `mjplug serve`: ready file, service manager, signals, time limit of the stop."""
