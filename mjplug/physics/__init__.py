"""The physics loop: steps, timers, waiting requests, pacing, resets."""
