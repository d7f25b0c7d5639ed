"""The physics loop: steps, timers, requests that wait, pacing, resets."""
