"""A ROS node as users of the bridge have one; it runs in a separate process, `ros_peer`."""

import queue
import subprocess
import threading
from multiprocessing.connection import Listener
from pathlib import Path
from types import SimpleNamespace

from bridge.process import PYTHON
from cli.process import environment
from waits import TIMEOUT, until


class Inbox:
    """What comes of one order."""

    def __init__(self):
        self._messages = queue.SimpleQueue()
        self.add = self._messages.put

    def next(self, within=TIMEOUT):
        try:
            return self._messages.get(timeout=within)
        except queue.Empty:
            raise AssertionError(f"nothing within {within} s") from None

    def drain(self):
        """Returns what has come so far."""
        return [self._messages.get() for _ in range(self._messages.qsize())]


class Answer:
    """The response to a pending call."""

    def __init__(self, inbox):
        self._inbox = inbox
        self._response = None

    @property
    def there(self):
        if self._response is None:
            for response in self._inbox.drain():
                self._response = response
        return self._response is not None

    def get(self):
        if not self.there:
            self._response = self._inbox.next()
        return SimpleNamespace(**self._response)


class RosSide:
    def __init__(self, address, env):
        listener = Listener(str(address))
        command = [PYTHON, str(Path(__file__).parent / "ros_peer.py")]
        self._process = subprocess.Popen(command, env=environment({**env, "ROS_PEER": str(address)}))
        self._connection = listener.accept()
        listener.close()
        self._done, self._news = {}, {}
        self._numbers = iter(range(10**9))
        threading.Thread(target=self._read, daemon=True).start()

    def subscribe(self, name, type_name, reliable=True, latched=False):
        """The raw messages of a subscription."""
        return self._order("subscribe", name, type_name, reliable, latched)[1]

    def publisher(self, name, type_name):
        """Returns a function that publishes bytes, after a subscriber was found."""
        publisher, _ = self._order("publisher", name, type_name)
        until(lambda: self._ask("readers", publisher) > 0)
        return lambda payload: self._ask("publish", publisher, payload)

    def is_ready(self, name, type_name):
        """Returns a function that returns whether a service is available."""
        client, _ = self._order("client", name, type_name)
        return lambda: self._ask("ready", client)

    def send(self, name, type_name, **fields):
        """Calls a service as soon as it is available."""
        client, _ = self._order("client", name, type_name)
        until(lambda: self._ask("ready", client))
        return Answer(self._order("send", client, type_name, fields)[1])

    def call(self, name, type_name, **fields):
        return self.send(name, type_name, **fields).get()

    def types(self, name):
        """The types that a topic has."""
        return self._ask("types", name)

    def forget(self):
        """Destroys what a test has made."""
        self._ask("forget")

    def close(self):
        self._send("leave")
        try:
            self._process.wait(TIMEOUT)
        finally:
            self._process.kill()
            self._process.wait()
            self._connection.close()

    def _ask(self, verb, *arguments):
        return self._done[self._send(verb, *arguments)].next()

    def _order(self, verb, *arguments):
        """Gives an order, waits until it has been carried out and returns its number and the news of it."""
        number = self._send(verb, *arguments)
        self._done[number].next()
        return number, self._news[number]

    def _send(self, verb, *arguments):
        number = next(self._numbers)
        self._done[number], self._news[number] = Inbox(), Inbox()
        self._connection.send((number, verb, arguments))
        return number

    def _read(self):
        while True:
            try:
                number, kind, answer = self._connection.recv()
            except (EOFError, OSError, TypeError):
                return
            (self._done if kind == "done" else self._news)[number].add(answer)
