"""A scheduler without a loop."""

from mjplug.physics.scheduler import Scheduler


class Answers:
    def __init__(self):
        self.responses, self.refusals = [], []

    def respond(self, response):
        self.responses.append(response)

    def refuse(self, reason):
        self.refusals.append(reason)


class Clocked(Scheduler):
    """A scheduler whose time is the last boundary that the test reported."""

    def __init__(self, step=0):
        super().__init__(lambda: self.step)
        self.step = step

    def run_due(self, step):
        self.step = step
        super().run_due(step)
