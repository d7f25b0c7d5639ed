"""Limits of numbers that users and clients choose, so that no calculation with them overflows."""

MIN_SPEED, MAX_SPEED = 1e-3, 1e3
"""Range of the real-time factor; use `max` for more than `MAX_SPEED`."""

MIN_TIMESTEP, MAX_TIMESTEP = 1e-9, 1e3
"""Range of the model's time step [s]; time stamps count nanoseconds."""

MAX_SIMULATED_TIME = 2**31 - 1
"""Maximum simulated time [s], about 68 years: the maximum of `builtin_interfaces/Time`."""

DEFAULT_VIEW_PORT = 8080
"""TCP port of the page of the simulation view."""
