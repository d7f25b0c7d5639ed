"""What all attackers share: their arguments, the list of findings, and the summary in one line."""

import argparse
import random
import time
from dataclasses import dataclass, field

MAX_FINDINGS = 20
"""An attack ends early after so many findings: the rest would mostly repeat them."""


def arguments(argv, description, count, seconds):
    """Reads the arguments of an attacker.

    Args:
        argv: The arguments, without the name of the program.
        description: One sentence for `--help`.
        count: Default number of inputs.
        seconds: Default limit of wall time [s].
    """
    parser = argparse.ArgumentParser(description=description)
    add_bounds(parser, count, seconds)
    return parser.parse_args(argv)


def add_bounds(parser, count, seconds):
    """Adds the arguments that bound an attack and repeat a part of it."""
    parser.add_argument("--count", type=int, default=count, help=f"number of inputs (default {count})")
    parser.add_argument("--seed", type=int, default=0, help="seed of all random choices (default 0)")
    parser.add_argument("--first", type=int, default=0, help="index of the first input: repeats a part of a run")
    parser.add_argument("--seconds", type=float, default=seconds, help=f"limit of wall time [s] (default {seconds:g})")


def random_of(seed, index):
    """Returns the source of randomness of one input, so that each input can be made again without the others."""
    return random.Random(seed << 40 ^ index)


@dataclass
class Tally:
    """Counts what came of an attack.

    Attributes:
        name: Name of the attack.
        seed: Its seed.
        seconds: Limit of wall time [s].
        inputs: Number of inputs so far.
        counts: Further numbers for the summary, such as `refused`.
        findings: One text for each finding.
        module: The module to run again, if inputs can be sent again one by one.
    """

    name: str
    seed: int
    seconds: float
    inputs: int = 0
    counts: dict = field(default_factory=dict)
    findings: list = field(default_factory=list)
    module: str = ""
    began: float = field(default_factory=time.monotonic)

    @property
    def over(self):
        """Whether the time is up, or there are too many findings to go on."""
        return time.monotonic() - self.began > self.seconds or len(self.findings) >= MAX_FINDINGS

    def count(self, what, by=1):
        self.counts[what] = self.counts.get(what, 0) + by

    def find(self, index, what, given=""):
        """Notes and prints a finding, with what is needed to repeat it."""
        text = f"{self.name}: seed {self.seed}, input {index}: {what}"
        self.findings.append(text)
        if len(self.findings) > MAX_FINDINGS:
            return
        print(f"FINDING {text}", flush=True)
        if given:
            print(f"    input: {repr(given)[:4000]}", flush=True)
        if isinstance(index, int) and self.module:
            print(f"    again: python -m {self.module} --seed {self.seed} --first {index} --count 1", flush=True)

    def end(self):
        """Prints the summary; returns the exit code."""
        seconds = time.monotonic() - self.began
        numbers = "".join(f", {number} {what}" for what, number in self.counts.items())
        rate = self.inputs / seconds if seconds else 0.0
        print(
            f"{self.name}: {self.inputs} inputs{numbers}, {len(self.findings)} findings "
            f"(seed {self.seed}, {seconds:.1f} s, {rate:.0f} inputs/s)",
            flush=True,
        )
        return 1 if self.findings else 0
