"""Bytes into a whole server without a socket: decoders, handlers, plugins and physics, one input after another.

`python -m hostile.in_process --count 100000 --seed 1` repeats the same inputs every time; `--first I --count 1` sends
one of them again.
"""

import logging
import sys
import threading
import time
from pathlib import Path

import numpy as np
import zenoh
from cli.client import wrench, wrenches
from hostile.attack import Tally, arguments
from hostile.byte_transport import ByteTransport, LocalInquiry
from hostile.inputs import Inputs, encoding_of
from hostile.observed import resident
from refusals import refusal_in

from mjplug.config.load import read
from mjplug.contracts.transport import ServiceName
from mjplug.model.file import load_model
from mjplug.physics import process
from mjplug.physics.simulation import Simulation
from mjplug.plugin.selection import select
from mjplug.server.offline import OfflineWorkerPool
from mjplug.server.server import Server
from mjplug.wire.encoding import Received
from mjplug.wire.rmw_zenoh.descriptions import TypeDescriptions
from mjplug_schemas.action import Action
from mjplug_schemas.registry import find
from mjplug_schemas.type_description_interfaces import GetTypeDescription

WORLD = Path(__file__).parent / "world" / "config.yaml"
SLICE = 250
"""After so many inputs, the world is reset, and all requests must have their answers."""

MAX_CPU = 5.0
"""One input that takes more processor time than this is a finding [s]; a limit for hangs, not for speed."""

MAX_GROWTH = 200 << 20
"""How much the process may grow after the first tenth of the inputs [bytes]."""


class Tracebacks(logging.Handler):
    """Keeps what was logged with a traceback."""

    def __init__(self):
        super().__init__(logging.WARNING)
        self.found = []

    def emit(self, record):
        if record.exc_info:
            self.found.append(logging.Formatter().format(record))


class Target:
    """A server on a `ByteTransport`."""

    def __init__(self):
        process.configure_mujoco()
        loaded, plugins = select(read(WORLD, environ={}))
        model = load_model(loaded.settings.model, *loaded.folders(("model",)))
        self.simulation = Simulation(model.model, "")
        self.transport = ByteTransport()
        self.server = Server(loaded.settings, self.simulation, self.transport, plugins, OfflineWorkerPool(), model)
        descriptions = TypeDescriptions({one.type_name: find(one.type_name) for one in self.transport.interfaces})
        described = ServiceName("/mjplug/get_type_description", GetTypeDescription)
        self.transport.open_service(described, lambda call: call.respond(descriptions.answer(call.request)))
        self.loop = self.server.loop
        # Some inputs name it.
        self.call("mjplug/save_state", {"name": "begin"})

    def send(self, given):
        """Decodes an input and executes it in the loop; returns the request, if it is one."""
        if given.verb == "get":
            raw = LocalInquiry(given, given.door == "ros2")
            self.transport.doors[given.interface.key].receive(raw)
        else:
            raw = None
            only = {"json": "json", "ros2": "cdr"}.get(given.door)
            encoding = None if given.door == "ros2" else encoding_of(given.encoding)
            for subscription in self.transport.inlets[given.interface.key]:
                subscription.receive(Received(zenoh.ZBytes(given.payload), encoding, only))
        self.loop.step(0)
        return raw

    def call(self, key, fields):
        """Sends a right request and returns its response."""
        service = find(next(one.type_name for one in self.transport.interfaces if one.key == key))
        given = LocalInquiry(_Right(service.Request.model_validate(fields).to_cdr()), True)
        self.transport.doors[key].receive(given)
        self.loop.step(0)
        self.settle()
        return service.Response.from_cdr(given.answers[0][0]) if given.answers else None

    def settle(self):
        """Waits until the answers so far have been sent."""
        done = threading.Event()
        self.transport.open_calls.replies.post(done.set)
        assert done.wait(30.0), "the thread that sends answers has ended"

    def check(self):
        """Ends all requests, and compares a push and a throw with mechanics; returns the deviations."""
        simulation, loop = self.simulation, self.loop
        for key, fields in (("mjplug/set_pause", {"paused": True}), ("mjplug/reset_world", {})):
            response = self.call(key, fields)
            if response is None or not response.success:
                return f"{key} answers {response!r}"
        if not (np.isfinite(simulation.data.qpos).all() and np.isfinite(simulation.data.qvel).all()):
            return "the state is not finite after a reset"
        thrown = {"name": "link_a", "twist": {"twist": {"linear": {"x": 0.5}}}}
        thrown["pose"] = {"pose": {"position": {"x": 7.0}}}
        response = self.call("mjplug/set_free_joint_state", {"free_joints": [thrown]})
        pushed = wrenches(wrench("link_b", force=(3.0, 0.0, 0.0), seconds=0.02))
        pushing = LocalInquiry(
            _Right(find("mujoco_ros2_control_msgs/srv/ApplyExternalWrench").Request.model_validate(pushed).to_cdr()),
            True,
        )
        self.transport.doors["external_wrench/apply_wrench"].receive(pushing)
        loop.step(20)
        self.settle()
        x = float(simulation.data.joint(1).qpos[0])
        v = float(simulation.data.joint(2).qvel[0])
        if abs(x - (7.0 + 0.5 * 20 * 0.002)) > 1e-9:
            return f"a body thrown with 0.5 m/s from x = 7 m is at {x} m after 40 ms"
        # 3 N for 20 ms on 3 kg.
        if abs(v - 0.02) > 1e-9:
            return f"a body of 3 kg pushed with 3 N for 20 ms has {v} m/s"
        return None if len(pushing.answers) == 1 else f"the push has {len(pushing.answers)} answers"


class _Right:
    """A right request in place of an input."""

    encoding, parameters = None, ""

    def __init__(self, payload):
        self.payload = payload


def attack(tally, first, count):
    """Sends inputs until they or the time are at their end."""
    target, tracebacks = Target(), Tracebacks()
    logger = logging.getLogger("mjplug")
    logger.addHandler(tracebacks)
    logger.propagate = False
    inputs = Inputs(target.transport.interfaces, tally.seed, ("plain", "json", "ros2"))
    open_inquiries, grown_from, slowest = [], None, (0.0, None)
    try:
        for index in range(first, first + count):
            given = inputs.make(index)
            if given.verb == "delete":
                continue
            began = time.thread_time()
            raw = target.send(given)
            if index % 5 == 0 and not target.loop._stopping:
                target.loop.step(2)
            slowest = max(slowest, (time.thread_time() - began, index))
            tally.inputs += 1
            if raw is not None:
                open_inquiries.append(raw)
            if slowest[0] > MAX_CPU and slowest[1] == index:
                tally.find(index, f"took {slowest[0]:.1f} s of processor time", given)
            if tracebacks.found:
                tally.find(index, tracebacks.found[0], given)
                tracebacks.found.clear()
            if target.loop._stopping:
                tally.find(index, f"the server stops: {target.loop.failure}", given)
                return
            if (index + 1 - first) % SLICE == 0 or index == first + count - 1:
                wrong = target.check()
                if wrong:
                    tally.find(f"{index - SLICE + 1}..{index}", wrong)
                _judge(tally, open_inquiries)
                open_inquiries = []
                if grown_from is None and tally.inputs >= min(count / 10, 20_000):
                    grown_from = resident()
                if tally.over:
                    break
        growth = resident() - (grown_from or resident())
        tally.counts["MiB grown"] = growth >> 20
        if growth > MAX_GROWTH:
            tally.find(f"{first}..{index}", f"memory grew by {growth >> 20} MiB")
        print(f"slowest input: {slowest[1]}, {slowest[0] * 1e3:.0f} ms of processor time", flush=True)
    finally:
        logger.removeHandler(tracebacks)
        logger.propagate = True
        target.server.cleanup()
        target.transport.open_calls.close("the attack is over")


def _judge(tally, inquiries):
    """Checks that each request has exactly one answer, of the right type."""
    for raw in inquiries:
        action = issubclass(find(raw.given.interface.type_name), Action)
        # An action sends feedback and the result too.
        if len(raw.answers) != 1 and not (action and raw.answers):
            tally.count("unanswered", not raw.answers)
            tally.find(raw.given.index, f"{len(raw.answers)} answers", raw.given)
            continue
        answer, form = raw.answers[0]
        reason = answer if form is None else None if action else _reason(raw.given.interface.type_name, answer, form)
        refused, sentence = reason is not None, "accepted" if reason is None else reason
        tally.count("refused", refused)
        if "internal error" in sentence or not sentence.strip() or len(sentence) > 100_000:
            tally.find(raw.given.index, f"the answer is {sentence[:300]!r}", raw.given)


def _reason(type_name, answer, form):
    """Returns why a request was refused, from its encoded response; None if it was not."""
    response_type = find(type_name).Response
    return refusal_in(response_type.from_cdr(answer) if form == "cdr" else response_type.from_json(answer))


def main(argv=None):
    """Runs the attack; returns the exit code."""
    options = arguments(argv, "Sends hostile bytes into a server without a socket.", 20_000, 600.0)
    tally = Tally(
        "in process", options.seed, options.seconds, counts={"refused": 0, "unanswered": 0}, module="hostile.in_process"
    )
    attack(tally, options.first, options.count)
    return tally.end()


if __name__ == "__main__":
    sys.exit(main())
