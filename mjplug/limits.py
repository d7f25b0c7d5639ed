"""Limits of numbers that people and clients choose, so that no calculation with them overflows."""

SLOWEST, FASTEST = 1e-3, 1e3
"""Range of the real-time factor; for more than `FASTEST`, use `max`."""

SHORTEST_STEP, LONGEST_STEP = 1e-9, 1e3
"""Range of the model's time step [s]; stamps count nanoseconds."""

LONGEST_TIME = 2**31 - 1
"""The latest simulated time that fits into a `builtin_interfaces/Time` [s]: 68 years."""
