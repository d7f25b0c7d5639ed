"""Runs all attackers one after another, in the long form: `make fuzz`."""

import argparse
import sys

from hostile import configuration, decoders, full_disk, in_process, saved_states, server_kills, stopped_callers, wire

SHARES = ((in_process, 0.6), (wire, 0.36), (configuration, 0.04))
"""What part of the inputs each attacker sends."""


def main(argv=None):
    """Runs the attackers; returns the exit code."""
    parser = argparse.ArgumentParser(description="Runs all attackers.")
    parser.add_argument("--count", type=int, default=100_000, help="inputs of all together (default 100000)")
    parser.add_argument("--seed", type=int, default=0, help="seed of all random choices (default 0)")
    parser.add_argument("--seconds", type=float, default=1800.0, help="limit of wall time of each [s] (default 1800)")
    options = parser.parse_args(argv)
    common = ["--seed", str(options.seed), "--seconds", str(options.seconds)]
    failed = 0
    for attacker, share in SHARES:
        failed |= attacker.main([*common, "--count", str(max(1, round(share * options.count)))])
    failed |= decoders.main([*common, "--count", str(options.count)])
    failed |= saved_states.main([*common, "--count", str(max(1, options.count // 50))])
    for attacker, count in ((server_kills, 10), (stopped_callers, 10), (full_disk, 40)):
        failed |= attacker.main([*common, "--count", str(count)])
    return failed


if __name__ == "__main__":
    sys.exit(main())
