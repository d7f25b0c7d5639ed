"""An object that the loop updates."""


class Recorder:
    """A stepper that notes the step number of each update."""

    def __init__(self, simulation):
        self.simulation, self.updates, self.resets = simulation, [], 0

    def update(self):
        self.updates.append(self.simulation.step)

    def on_reset(self):
        self.resets += 1
