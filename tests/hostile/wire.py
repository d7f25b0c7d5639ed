"""Hostile inputs over the wire: a real server in a separate process, and everything that a Zenoh client can send.

Inputs go out in slices with many requests in flight. After each slice the world is reset, which ends what waits; every
request must have exactly one answer, the server must do what mechanics says, and its log must have no traceback.
`python -m hostile.wire --seed S --first I --count N` sends the inputs I to I + N - 1 of a run again.
"""

import json
import sys
import threading
import time
from pathlib import Path

import zenoh
from cli.client import JSON, Client, wrench, wrenches
from cli.process import Served
from hostile.attack import Tally, arguments, random_of
from hostile.inputs import Inputs, encoding_of, interfaces_of
from hostile.neighbours import disturbances
from hostile.observed import file_descriptors, resident, threads
from zenoh.handlers import Callback

TESTS = Path(__file__).parents[1]
WORLD = Path(__file__).parent / "world" / "config.yaml"

SLICE = 500
"""Inputs in flight at the same time."""

ANSWER = 60.0
"""How long the last answer of a slice may take on a busy machine [s]."""

MAX_GROWTH = 150 << 20
"""How much the server may grow between the first tenth of the inputs and the end [bytes]."""

MAX_FURTHER = 8
"""How many more file descriptors or threads the server may have at the end."""

MOST_LOG, MOST_LOG_OF_SLICE = 60_000, 1_500
"""Characters of the server's log, and those that each slice may add: a flood of bad input is no flood of log lines."""

_CONTROL = 20.0


def environment_of_world():
    """Returns the environment in which the plugin `cli.world.probe:Probe` is found."""
    return {"PYTHONPATH": str(TESTS)}


class Answers:
    """Counts the answers to the requests of a slice."""

    def __init__(self):
        self._lock = threading.Lock()
        self._open = set()
        self.replies = {}
        self.refused = 0
        self.bad = {}
        self.all_there = threading.Condition(self._lock)

    def expect(self, given):
        with self._lock:
            self._open.add(given.index)
            self.replies[given.index] = 0

        def reply(reply):
            with self._lock:
                self.replies[given.index] += 1
                if reply.ok is None:
                    self.refused += 1
                    sentence = reply.err.payload.to_bytes()
                else:
                    sentence = reply.ok.payload.to_bytes() if given.one_answer else b""
                    self.refused += b'"success":false' in sentence
                if b"internal error" in sentence or sentence == b"Timeout":
                    self.bad[given.index] = sentence[:300]

        def close():
            with self.all_there:
                self._open.discard(given.index)
                self.all_there.notify_all()

        return Callback(reply, drop=close, indirect=False)

    def forget(self, given):
        """Takes back `expect` for a request that was not sent."""
        with self._lock:
            self._open.discard(given.index)
            self.replies.pop(given.index, None)

    def wait(self, seconds):
        """Waits until all requests have ended; returns those that have not."""
        with self.all_there:
            self.all_there.wait_for(lambda: not self._open, seconds)
            return set(self._open)


class Target:
    """A server and the client that attacks it."""

    def __init__(self):
        self.server = Served(str(WORLD), cwd=WORLD.parent, env=environment_of_world())
        try:
            self.client = Client(self.server.endpoint, WORLD.parent / "patient.json5")
            self.interfaces = interfaces_of(self.client.ask("mjplug/interfaces"))
            # Some inputs name it.
            self.ask("mjplug/save_state", name="begin")
        except BaseException:
            self.server.kill()
            raise
        self._read = 0

    def log(self):
        """Returns what the server has logged since the last call."""
        text = self.server.err.text
        new, self._read = text[self._read :], len(text)
        return new

    def send(self, given, answers):
        """Sends one input."""
        session, attachment = self.client.session, given.attachment
        if given.verb == "get":
            session.get(
                given.selector,
                answers.expect(given),
                payload=given.payload,
                encoding=encoding_of(given.encoding),
                attachment=attachment,
                timeout=ANSWER + 30.0,
            )
        elif given.verb == "put":
            session.put(
                given.key,
                given.payload,
                encoding=encoding_of(given.encoding),
                attachment=attachment,
                congestion_control=zenoh.CongestionControl.BLOCK,
            )
        else:
            session.delete(given.key, attachment=attachment)

    def ask(self, key, **fields):
        answer = self.client.send(key, json.dumps(fields), JSON, timeout=_CONTROL).answer(_CONTROL + 5.0)
        return answer.json if answer.ok else {"success": False, "message": answer.payload.decode()}

    def reset(self):
        """Ends everything that waits; returns what is wrong."""
        for key, fields in (("mjplug/set_pause", {"paused": True}), ("mjplug/reset_world", {})):
            response = self.ask(key, **fields)
            if response["success"] is not True:
                return f"{key} answers {response}"
        return None

    def check(self):
        """Compares a throw and a push with mechanics; returns the deviations."""
        thrown = {"name": "link_a", "pose": {"pose": {"position": {"x": 7.0}}}}
        thrown["twist"] = {"twist": {"linear": {"x": 0.5}}}
        self.ask("mjplug/set_free_joint_state", free_joints=[thrown])
        before = json.loads(self.ask("probe/state")["message"])
        pushed = wrenches(wrench("link_b", force=(3.0, 0.0, 0.0), seconds=0.02))
        pushing = self.client.send("external_wrench/apply_wrench", json.dumps(pushed), JSON, timeout=_CONTROL)
        stepped = self.ask("mjplug/step_simulation", steps=20)
        answer = pushing.answer(_CONTROL)
        state = json.loads(self.ask("probe/state")["message"])
        x, v = state["qpos"][7], state["qvel"][12]
        if state["step"] != before["step"] + 20 or abs(x - (7.0 + 0.5 * 20 * 0.002)) > 1e-9 or abs(v - 0.02) > 1e-9:
            return f"after 20 steps of 2 ms: x = {x} m, not 7.02; v = {v} m/s, not 0.02; {stepped}; {answer}"
        if not answer.ok or not answer.json["success"]:
            return f"a right push is answered {answer}"
        if not all(abs(value) < 1e10 for value in state["qpos"] + state["qvel"]):
            return f"the state is not finite: {state}"
        return None

    def holds(self):
        """Returns what the server holds."""
        pid = self.server.process.pid
        return {"RSS": resident(pid), "fds": file_descriptors(pid), "threads": threads(pid)}

    def close(self):
        self.client.session.close()
        if self.server.running:
            code = self.server.stop(within=30.0)
            return None if code == 0 else f"the server ended with {code}"
        return f"the server has ended with {self.server.process.returncode}:\n{self.server.err.text[-2000:]}"


def attack(tally, first, count):
    """Sends inputs until they or the time are at their end."""
    target = Target()
    inputs = Inputs(target.interfaces, tally.seed)
    before = None
    index = first
    try:
        while index < first + count and not tally.over:
            size = min(SLICE, first + count - index)
            slice_name = f"{index}..{index + size - 1}"
            if not _slice(tally, target, inputs, index, size, slice_name):
                target.server.kill()
                target = Target()
                before = None
            index += size
            if before is None and tally.inputs > min(count / 10, 20_000):
                before = target.holds()
        _compare(tally, target, before, f"{first}..{index - 1}")
    finally:
        wrong = target.close()
    logged = len(target.server.err.text)
    tally.counts["characters logged"] = logged
    if logged > MOST_LOG + MOST_LOG_OF_SLICE * tally.inputs / SLICE:
        tally.find(f"{first}..{index - 1}", f"{logged} characters in the log: ...{target.server.err.text[-1500:]}")
    if wrong:
        tally.find(f"{first}..{index - 1}", wrong)


def _slice(tally, target, inputs, index, size, name):
    """Sends a slice; returns whether the server can go on."""
    random = random_of(tally.seed, 1 << 39 | index)
    disturbed = random.random() < 0.15
    declared = disturbances(target.client.session, target.interfaces, random) if disturbed else []
    answers, sent = Answers(), {}
    for given in map(inputs.make, range(index, index + size)):
        sent[given.index] = given
        try:
            target.send(given, answers)
        except zenoh.ZError as error:
            # Zenoh's own library refuses it in the sender: it never leaves.
            tally.count("refused in the sender")
            answers.forget(given)
            if "key" not in str(error).lower():
                raise
    tally.inputs += size
    for one in declared:
        one.undeclare()
    try:
        # Twice: what is in flight during the first reset may wait for the second.
        wrong = target.reset() or (answers.wait(2.0) and target.reset()) or None
        unanswered = answers.wait(ANSWER)
        wrong = wrong or target.check()
    except AssertionError as error:
        wrong, unanswered = f"a control call has no answer: {error}", answers.wait(0.0)
    tally.count("refused", answers.refused)
    tally.count("unanswered", 0)
    for one in sorted(unanswered):
        tally.count("unanswered")
        tally.find(one, "no answer", sent[one])
    for one, replies in answers.replies.items():
        if one not in unanswered and sent[one].one_answer and replies != 1 and not disturbed:
            tally.count("unanswered", replies == 0)
            tally.find(one, f"{replies} answers", sent[one])
    for one, sentence in answers.bad.items():
        tally.find(one, f"the answer is {sentence!r}", sent[one])
    if not target.server.running:
        tally.find(name, f"the server ended with {target.server.process.returncode}: {target.log()[-3000:]}")
        return False
    log = target.log()
    if wrong:
        tally.find(name, f"{wrong}; the log ends with: {log[-1500:]}")
        return False
    if "Traceback" in log or "panicked" in log:
        at = max(log.find("Traceback"), log.find("panicked"))
        tally.find(name, f"the log has a traceback: ...{log[max(0, at - 300) : at + 2500]}")
    return True


def _compare(tally, target, before, name):
    """Compares what the server holds with what it held after the first inputs."""
    if before is None or not target.server.running:
        return
    deadline = time.monotonic() + 10.0
    while True:
        after = target.holds()
        growth = {key: after[key] - before[key] for key in after}
        small = growth["fds"] <= MAX_FURTHER and growth["threads"] <= MAX_FURTHER
        if small or time.monotonic() > deadline:
            break
        time.sleep(0.2)
    tally.counts["MiB grown"] = growth["RSS"] >> 20
    if not small or growth["RSS"] > MAX_GROWTH:
        tally.find(name, f"the server holds more than before: {before} -> {after}")


def main(argv=None):
    """Runs the attack; returns the exit code."""
    options = arguments(argv, "Sends hostile inputs to a server over the wire.", 20_000, 600.0)
    tally = Tally("wire", options.seed, options.seconds, counts={"refused": 0, "unanswered": 0}, module="hostile.wire")
    attack(tally, options.first, options.count)
    return tally.end()


if __name__ == "__main__":
    sys.exit(main())
