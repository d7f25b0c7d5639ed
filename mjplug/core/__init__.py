"""The physics loop and what it owns: the model, its state, steps, timers, resets."""
