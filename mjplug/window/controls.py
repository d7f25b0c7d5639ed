"""Controls a server from a window: pause, step, reset, speed."""

import threading
from collections.abc import Callable
from queue import SimpleQueue

from mjplug.client import Client
from mjplug.client.parameters import set_one
from mjplug.errors import MjplugError


class Controls:
    """Calls services of a server, one after the other on its own thread, so that the window does not wait.

    Args:
        client: A connection to the server.
        server: The server's full name.
        report: Called with a sentence when a request is refused or not answered.
    """

    def __init__(self, client: Client, server: str, report: Callable[[str], None]) -> None:
        self._client = client
        self._server = server
        self._report = report
        self._requests: SimpleQueue[Callable[[], object] | None] = SimpleQueue()
        self._thread = threading.Thread(target=self._run, name="window controls", daemon=True)
        self._thread.start()

    def pause(self, paused: bool) -> None:
        """Pauses or resumes the simulation."""
        self._requests.put(lambda: self._client.call(f"{self._server}/set_pause", paused=paused))

    def step(self) -> None:
        """Takes one step of the paused simulation."""
        self._requests.put(lambda: self._client.call(f"{self._server}/step_simulation", steps=1))

    def reset(self, keyframe: str = "") -> None:
        """Resets the simulation.

        Args:
            keyframe: Name of the keyframe; empty means the initial state.
        """
        self._requests.put(lambda: self._client.call(f"{self._server}/reset_world", keyframe=keyframe))

    def set_speed(self, speed: float) -> None:
        """Sets the speed: simulated seconds per second of wall time."""
        self._requests.put(lambda: set_one(self._client, self._server, "sim.speed", speed))

    def close(self) -> None:
        """Ends the thread after the requests that are under way."""
        self._requests.put(None)
        self._thread.join(1.0)

    def _run(self) -> None:
        while request := self._requests.get():
            try:
                request()
            except MjplugError as error:
                self._report(str(error))
