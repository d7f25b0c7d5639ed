"""A client as anybody might write it: nothing but Zenoh and JSON."""

import json
import queue
from dataclasses import dataclass

import zenoh
from waits import TIMEOUT
from zenoh.handlers import Callback

JSON = zenoh.Encoding.APPLICATION_JSON


@dataclass(frozen=True)
class Answer:
    """What came back: a response, or an error reply."""

    ok: bool
    payload: bytes
    encoding: str
    attachment: bytes | None = None

    @property
    def json(self):
        return json.loads(self.payload)

    @property
    def sentence(self):
        """Returns the reason of a refusal, from an error reply or from a response."""
        if self.ok:
            assert self.json["success"] is False, self
            return self.json["message"]
        assert self.encoding == "text/plain", self
        return self.payload.decode()


class Pending:
    """A request that has been sent."""

    def __init__(self):
        self._replies = queue.SimpleQueue()

    def add(self, reply):
        result = reply.ok if reply.ok is not None else reply.err
        attachment = reply.ok.attachment if reply.ok is not None else None
        self._replies.put(
            Answer(
                reply.ok is not None,
                result.payload.to_bytes(),
                str(result.encoding),
                None if attachment is None else attachment.to_bytes(),
            )
        )

    def close(self):
        self._replies.put(None)

    @property
    def answered(self):
        return not self._replies.empty()

    def answer(self, within=TIMEOUT):
        try:
            answer = self._replies.get(timeout=within)
        except queue.Empty:
            raise AssertionError(f"no answer within {within} s") from None
        assert answer is not None, "the request ended without an answer"
        return answer


class Listener:
    """A subscription."""

    def __init__(self):
        self._samples = queue.SimpleQueue()

    def add(self, sample):
        self._samples.put(sample)

    def sample(self, within=TIMEOUT):
        try:
            return self._samples.get(timeout=within)
        except queue.Empty:
            raise AssertionError(f"no sample within {within} s") from None

    def next(self, within=TIMEOUT):
        return json.loads(self.sample(within).payload.to_bytes())

    def drain(self):
        """Returns the messages that have come so far."""
        return [self.next() for _ in range(self._samples.qsize())]

    def forget(self):
        """Drops what has come so far."""
        for _ in range(self._samples.qsize()):
            self._samples.get()

    def until(self, condition, within=TIMEOUT):
        """Returns the first message that fulfils a condition, and drops those before it."""
        while True:
            message = self.next(within)
            if condition(message):
                return message


class Client:
    """A Zenoh client session."""

    def __init__(self, endpoint, config_file=None):
        config = zenoh.Config() if config_file is None else zenoh.Config.from_file(str(config_file))
        config.insert_json5("mode", '"client"')
        config.insert_json5("connect/endpoints", json.dumps([endpoint]))
        config.insert_json5("scouting/multicast/enabled", "false")
        self.session = zenoh.open(config)
        self._subscribers = []

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.session.close()

    def send(self, selector, payload=None, encoding=None, attachment=None, timeout=TIMEOUT):
        """Sends a request as it stands."""
        pending = Pending()
        self.session.get(
            selector,
            # Directly, since otherwise Zenoh starts a thread for each request.
            Callback(pending.add, drop=pending.close, indirect=False),
            payload=payload,
            encoding=encoding,
            attachment=attachment,
            timeout=timeout,
        )
        return pending

    def request(self, selector, **fields):
        """Sends a request in JSON."""
        return self.send(selector, json.dumps(fields), JSON)

    def ask(self, selector, **fields):
        """Sends a request in JSON and returns the response."""
        answer = self.request(selector, **fields).answer()
        assert answer.ok, answer.payload.decode()
        assert answer.encoding == "application/json"
        return answer.json

    def do(self, selector, **fields):
        """Like `ask`, for a request that must succeed; returns the message."""
        response = self.ask(selector, **fields)
        assert response["success"] is True, response
        return response["message"]

    def listen(self, key):
        listener = Listener()
        self._subscribers.append(self.session.declare_subscriber(key, Callback(listener.add, indirect=False)))
        return listener

    def put(self, key, payload, encoding=None, attachment=None):
        block = zenoh.CongestionControl.BLOCK
        self.session.put(key, payload, encoding=encoding, attachment=attachment, congestion_control=block)


def wrench(body, force=(0.0, 0.0, 0.0), torque=(0.0, 0.0, 0.0), point=(0.0, 0.0, 0.0), seconds=0.0, ramp=0.0):
    """One wrench in the fields of mujoco_ros2_control_msgs/ExternalWrench."""

    def vector(values):
        return dict(zip("xyz", values, strict=True))

    def duration(value):
        nanoseconds = round(value * 1e9)
        return {"sec": nanoseconds // 10**9, "nanosec": nanoseconds % 10**9}

    return {
        "wrench": {"header": {"frame_id": body}, "wrench": {"force": vector(force), "torque": vector(torque)}},
        "application_point": vector(point),
        "duration": duration(seconds),
        "ramp_down_duration": duration(ramp),
    }


def wrenches(*them):
    """The fields of a request to apply_wrench."""
    return {"wrenches": {"external_wrenches": list(them)}}
