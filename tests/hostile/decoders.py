"""Coverage-guided fuzzing of the CDR and JSON decoders of every message type, by atheris where it is installed.

atheris keeps the inputs that reach new code and mutates those: `pip install atheris` into the environment enables it.
What is decoded must come out the same after it has been encoded and decoded again.
"""

import subprocess
import sys
from importlib.util import find_spec

from hostile.attack import arguments


def try_one(types, raw):
    """Decodes bytes as the type that the first byte names; anything but a refusal or a message raises."""
    from mjplug_schemas.errors import CodecError

    if len(raw) < 2:
        return
    message_type, as_json = types[raw[0] % len(types)], raw[1] & 1
    try:
        message = message_type.from_json(raw[2:]) if as_json else message_type.from_cdr(raw[2:])
    except CodecError as error:
        if not 5 < len(str(error)) < 100_000:
            raise AssertionError(f"no sentence: {error}") from error
        return
    again = message_type.from_cdr(message.to_cdr())
    assert again.to_cdr() == message.to_cdr()
    assert message_type.from_json(message.to_json()).to_json() == message.to_json()


def message_types():
    """Returns all messages, requests, responses and messages of actions, in a fixed order."""
    from mjplug_schemas.action import Action
    from mjplug_schemas.message import Message
    from mjplug_schemas.registry import all_types

    found = []
    for interface in all_types().values():
        if issubclass(interface, Action):
            found += [part for part in interface.derived().values() if issubclass(part, Message)]
        else:
            found += [interface] if issubclass(interface, Message) else [interface.Request, interface.Response]
    return found


def _guided(count, seed, seconds):
    """Runs atheris in this process; it ends the process."""
    import atheris

    with atheris.instrument_imports(include=["mjplug_schemas"]):
        types = message_types()
    options = [sys.argv[0], f"-runs={count}", f"-seed={seed + 1}", f"-max_total_time={int(seconds)}", "-max_len=4096"]
    atheris.Setup([*options, "-print_final_stats=1"], lambda raw: try_one(types, raw))
    atheris.Fuzz()


def main(argv=None):
    """Runs the attack in a separate process; returns the exit code."""
    options = arguments(argv, "Fuzzes the decoders of all message types with atheris.", 100_000, 600.0)
    if find_spec("atheris") is None:
        print("decoders: skipped: atheris is not installed", flush=True)
        return 0
    command = [
        sys.executable,
        "-m",
        "hostile.decoders",
        "guided",
        *map(str, (options.count, options.seed, options.seconds)),
    ]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=options.seconds + 120, check=False)
    numbers = [line for line in ended.stderr.splitlines() if "number_of_executed_units" in line]
    if ended.returncode != 0:
        print(f"FINDING decoders: seed {options.seed}: {ended.stderr[-4000:]}", flush=True)
    inputs = numbers[0].split()[-1] if numbers else "0"
    print(f"decoders: {inputs} inputs, {int(ended.returncode != 0)} findings (seed {options.seed})", flush=True)
    return 1 if ended.returncode else 0


if __name__ == "__main__":
    if sys.argv[1:2] == ["guided"]:
        _guided(int(sys.argv[2]), int(sys.argv[3]), float(sys.argv[4]))
    else:
        sys.exit(main())
