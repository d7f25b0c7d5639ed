"""The one context: command line, signals, and the connection to the graph."""

import itertools
import json
import os
import signal
import sys
import threading
from multiprocessing.connection import Client

from rclpy.signals import SignalHandlerOptions


class Context:
    def __init__(self):
        self.ok = False
        self.signalled = False
        self.parameters = {}
        self.topics = {}
        self._handlers = {}
        self._on_shutdown = []
        self._sending = threading.Lock()
        self._connection = None

    def start(self, args, signals):
        if self.ok:
            raise RuntimeError("Context.init() must only be called once")
        self.parameters = _parameters(sys.argv[1:] if args is None else args)
        self._connection = Client(os.environ["RCLPY_STAND_IN"])
        self.ok = True
        threading.Thread(target=self._read, daemon=True).start()
        if signals == SignalHandlerOptions.ALL:
            for number in (signal.SIGINT, signal.SIGTERM):
                signal.signal(number, self._signalled)

    def shutdown(self):
        if not self.ok:
            raise RuntimeError("context is not valid, or was shut down before")
        self.ok = False
        self._connection.close()
        for wake in self._on_shutdown:
            wake()

    def on_shutdown(self, wake):
        self._on_shutdown.append(wake)

    def send(self, *message):
        with self._sending:
            if self.ok:
                self._connection.send(message)

    def handle(self, entity, handler):
        """Calls `handler(kind, *data)`, on the reading thread, for what is sent to an entity."""
        if handler is None:
            self._handlers.pop(entity, None)
        else:
            self._handlers[entity] = handler

    def _read(self):
        while True:
            try:
                kind, entity, *data = self._connection.recv()
            except (EOFError, OSError, TypeError):
                return
            if kind == "topics":
                self.topics = data[0]
            elif handler := self._handlers.get(entity):
                handler(kind, *data)

    def _signalled(self, number, frame):
        self.signalled = True
        if self.ok:
            self.shutdown()
        if number == signal.SIGINT:
            signal.default_int_handler(number, frame)


def _parameters(arguments):
    """Reads `--ros-args --params-file FILE`; JSON is the YAML that needs no parser."""
    given = {}
    for option, value in itertools.pairwise(arguments):
        if option == "--params-file":
            with open(value, encoding="utf-8") as file:
                for node, content in json.load(file).items():
                    given[node] = dict(_flat(content["ros__parameters"]))
    return given


def _flat(tree, prefix=""):
    for name, value in tree.items():
        if isinstance(value, dict):
            yield from _flat(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", value


context = Context()
