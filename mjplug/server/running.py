"""A server inside a Python program: run by a thread of its own, or stepped by the thread that opened it.

The thread that takes the steps is the physics thread. With `run=True` it is a thread that `RunningServer` starts; with
`run=False` it is the stepping thread: the thread of the program that opened the server and calls `step`.
"""

import atexit
import operator
import os
import threading
from collections.abc import Callable
from concurrent.futures import Future
from contextlib import closing
from types import TracebackType
from typing import Any, TypeVar
from weakref import WeakSet

import mujoco

from mjplug.client import Client
from mjplug.client.connection import Timeouts, open_client
from mjplug.errors import MjplugError
from mjplug.log_scope import LogScope
from mjplug.server.local_calls import LocalCall
from mjplug.server.local_client import LocalClient
from mjplug.server.opened import OpenedServer
from mjplug.server.prepared import Prepared
from mjplug.server.whereabouts import whereabouts

_MAX_STEPS = 2**32 - 1
"""Maximum number of steps in a request to `~/step_simulation`."""

STOP_TIMEOUT = 10.0
"""Maximum time that `RunningServer.stop` waits for the physics thread to end [s]."""

T = TypeVar("T")


class RunningServer:
    """A server in this process. `open_server` returns one.

    It is a context manager that stops the server at the end of the block. If an error stops the physics thread, the
    next call of `wait`, `step` or `stop` raises it, or the end of the block.

    Attributes:
        name: The server's full name, such as `/robot1/mjplug`.
        endpoint: The Zenoh endpoint where clients connect, such as `tcp/127.0.0.1:40123`.

    Args:
        prepared: Its configuration, model and plugins.
        scope: Which log lines belong to it.
        run: Whether a thread of its own runs the server; otherwise the caller steps it.
        duration: Simulated time after which the server stops [s]; None means no limit. Only with `run`.
    """

    def __init__(self, prepared: Prepared, scope: LogScope, run: bool, duration: float | None) -> None:
        self.name = prepared.name
        self._prepared = prepared
        self._scope = scope
        self._clients: WeakSet[Client] = WeakSet()
        self._local: LocalClient | None = None
        self._failure: BaseException | None = None
        self._raised = False
        self._stopped = False
        self._stepping_thread: threading.Thread | None = None
        self._thread: threading.Thread | None = None
        if run:
            self._opened = self._open_in_thread(duration)
        else:
            self._stepping_thread = threading.current_thread()
            self._opened = self._open()
        self.endpoint = self._opened.endpoint
        # An open Zenoh session would prevent the end of the process.
        atexit.register(self._stop_at_exit)

    @property
    def running(self) -> bool:
        """Whether the server is open: neither stopped nor, with `run=True`, ended by itself."""
        return not self._stopped and (self._thread is None or self._thread.is_alive())

    @property
    def time_ns(self) -> int:
        """Simulated time since the start [ns]."""
        return self._prepared.simulation.time_ns

    @property
    def model(self) -> mujoco.MjModel:
        """The compiled model. Only with `run=False`.

        Raises:
            MjplugError: The model belongs to the physics thread.
        """
        self._check_stepping_thread("model")
        return self._prepared.simulation.model

    @property
    def data(self) -> mujoco.MjData:
        """The state between two steps, to be read. Only with `run=False`.

        Raises:
            MjplugError: The state belongs to the physics thread.
        """
        self._check_stepping_thread("data")
        return self._prepared.simulation.data

    def client(self, *, timeout: float = 5.0, config: str | os.PathLike[str] | None = None) -> Client:
        """Connects a client to the server. In its names, `~` is this server.

        With `run=False`, a service call on the stepping thread handles requests until it gets the response. Messages of
        the server's topics arrive with the next `step`.

        Args:
            timeout: Maximum time to wait for the connection [s].
            config: A Zenoh configuration file for the client: certificates, passwords and so on.

        Returns:
            A new client. `stop` closes it if it is still open.

        Raises:
            NoServerError: The server has stopped or refuses the client.
        """
        client = open_client(self.endpoint, self.name, Timeouts(timeout, timeout), config, self._client_class())
        self._clients.add(client)
        return client

    @property
    def local(self) -> LocalClient:
        """A client without a network: it steps the server as `Client` does, with the same results.

        With `run=False`, only the thread that opened the server may use it; with `run=True`, any thread but the physics
        thread.

        Raises:
            MjplugError: This thread must not use it, or the server has been stopped.
        """
        if self._thread is None:
            self._check_stepping_thread("local")
        elif self._stopped or threading.current_thread() is self._thread:
            raise MjplugError(f"local: {self.name} was stopped, or this is its physics thread")
        if self._local is None:
            serve = self._serve_locally if self._thread is None else None
            self._local = LocalClient(self.name, self._opened, serve, lambda: self.running)
        return self._local

    def step(self, steps: int = 1) -> None:
        """Takes physics steps, as a request to `~/step_simulation` does. Only with `run=False`.

        Requests and messages that clients sent before the call are applied before the first step.

        Args:
            steps: Number of steps. With 0, only the waiting requests and messages are handled.

        Raises:
            RequestError: Not all steps were taken, because the simulation diverged or a client resumed it; the text
                contains the reason and the number of steps that were taken.
            MjplugError: A plugin failed, or the simulation diverged, under a policy that stops the server.
        """
        self._check_stepping_thread("step")
        taken = _count(steps)
        with self._scope.active():
            self._keeping_failure(lambda: self._opened.step(taken))

    def wait(self, timeout: float | None = None) -> bool:
        """Waits until the server stops by itself, or another thread calls `stop`.

        With `run=False`, this call handles requests in the meantime, and takes the steps that clients request.

        Args:
            timeout: Maximum time to wait [s]; None means no limit.

        Returns:
            Whether the server has stopped.

        Raises:
            MjplugError: The server failed.
        """
        if self._thread is not None:
            self._thread.join(timeout)
            if self._thread.is_alive():
                return False
            self._raise_failure()
            return True
        self._check_stepping_thread("wait")
        with self._scope.active():
            return self._keeping_failure(lambda: self._opened.serve_for(timeout))

    def stop(self) -> None:
        """Stops the server and closes its clients; a second call does nothing.

        On another thread than the stepping thread (`run=False`), and on the physics thread itself (`run=True`), it only
        asks the server to stop, and returns at once. A `wait` then ends.

        Raises:
            MjplugError: The server failed, and no other call has raised the error; or it did not stop within
                `STOP_TIMEOUT`.
        """
        self._stop()
        if self._failure is not None and not self._raised:
            self._raise_failure()

    def __enter__(self) -> "RunningServer":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if error is None:
            self.stop()
            return
        try:
            self._stop()
        except MjplugError as hanging:
            error.add_note(str(hanging))
        if self._failure is not None and self._failure is not error:
            error.add_note(f"the server {self.name} had failed before: {self._failure!r}")

    def _open(self) -> OpenedServer:
        """Opens the server on the calling thread, which becomes its physics thread."""
        with self._scope.active():
            opened = OpenedServer(self._prepared)
            try:
                opened.wait_until_ready()
            except BaseException:
                opened.close()
                raise
            return opened

    def _open_in_thread(self, duration: float | None) -> OpenedServer:
        opening: Future[OpenedServer] = Future()
        # A daemon thread, because a program that does not stop the server must end too.
        self._thread = threading.Thread(
            target=self._run, args=(opening, duration), name=f"mjplug {self.name}", daemon=True
        )
        self._thread.start()
        try:
            return opening.result()
        except KeyboardInterrupt:
            # The caller does not get the server, so it stops as soon as it is open.
            opening.add_done_callback(_interrupt)
            raise

    def _run(self, opening: "Future[OpenedServer]", duration: float | None) -> None:
        """Opens the server, runs it and closes it, on the physics thread."""
        try:
            opened = self._open()
        except BaseException as error:
            opening.set_exception(error)
            return
        try:
            with self._scope.active(), closing(opened):
                opening.set_result(opened)
                opened.run(duration)
        except BaseException as error:
            # The next call of `wait` or `stop` raises it.
            self._failure = error

    def _stop(self, at_exit: bool = False) -> None:
        here, stepping_thread = threading.current_thread(), self._stepping_thread
        on_other_thread = stepping_thread not in (None, here) and not at_exit
        if not self._stopped and (here is self._thread or on_other_thread):
            # The physics thread closes the server, so that plugins are cleaned up there.
            self._opened.interrupt()
            return
        if self._stopped:
            return
        self._stopped = True
        atexit.unregister(self._stop_at_exit)
        for client in list(self._clients):
            client.close()
        if self._thread is None:
            with self._scope.active():
                self._opened.close()
            return
        self._opened.interrupt()
        self._thread.join(STOP_TIMEOUT)
        if self._thread.is_alive():
            place = whereabouts(self._opened.server.plugins, self._thread)
            raise MjplugError(f"{self.name} did not stop within {STOP_TIMEOUT:g} s: {place} did not return")

    def _stop_at_exit(self) -> None:
        """Stops the server at the end of the process, if the program has not stopped it."""
        self._stop(at_exit=True)

    def _keeping_failure(self, act: Callable[[], T]) -> T:
        """Calls `act` on the stepping thread; if the server fails in it, keeps the error in `_failure`."""
        try:
            return act()
        except MjplugError as error:
            if self._opened.server.loop.failure is error:
                self._failure, self._raised = error, True
            raise

    def _raise_failure(self) -> None:
        if self._failure is not None:
            self._raised = True
            raise self._failure

    def _check_stepping_thread(self, what: str) -> None:
        if self._stepping_thread is None:
            raise MjplugError(f"{what} needs run=False: the physics thread of {self.name} owns the state")
        if self._stopped:
            raise MjplugError(f"the server {self.name} has been stopped")
        if self._stepping_thread is not threading.current_thread():
            raise MjplugError(f"{what}: {self.name} belongs to the thread that opened it")

    def _serve_locally(self, call: LocalCall) -> None:
        """Handles requests on the stepping thread until a call is answered."""
        self._check_stepping_thread("local")
        with self._scope.active():
            self._keeping_failure(lambda: self._opened.serve_until(lambda: call.answered))

    def _serve_while(self, wait: Callable[[], T]) -> T:
        """Calls `wait`, which waits for the server, on another thread, and handles requests until it returns."""
        opened, result = self._opened, Future[T]()

        def run() -> None:
            try:
                result.set_result(wait())
            except BaseException as error:
                result.set_exception(error)
            # Wakes the loop, so that it checks whether `result` is done.
            opened.server.loop.inbox.post(lambda: None)

        threading.Thread(target=run, name="mjplug call", daemon=True).start()
        with self._scope.active():
            self._keeping_failure(lambda: opened.serve_until(result.done))
        return result.result()

    def _client_class(self) -> type[Client]:
        stepping_thread, serve_while = self._stepping_thread, self._serve_while
        if stepping_thread is None:
            return Client

        class ServingClient(Client):
            """Handles requests while the stepping thread waits for a response; otherwise it would wait for itself."""

            def call(self, *args: Any, **kwargs: Any) -> Any:
                if threading.current_thread() is not stepping_thread:
                    return super().call(*args, **kwargs)
                return serve_while(lambda: super(ServingClient, self).call(*args, **kwargs))

            def send_goal(self, *args: Any, **kwargs: Any) -> Any:
                if threading.current_thread() is not stepping_thread:
                    return super().send_goal(*args, **kwargs)
                return serve_while(lambda: super(ServingClient, self).send_goal(*args, **kwargs))

        return ServingClient


def _interrupt(opening: "Future[OpenedServer]") -> None:
    if opening.exception() is None:
        opening.result().interrupt()


def _count(steps: object) -> int:
    """Returns a number of steps, if a request can contain it; NumPy's integers are valid too."""
    try:
        count = operator.index(steps)  # type: ignore[arg-type]
    except TypeError:
        count = -1
    if not 0 <= count <= _MAX_STEPS:
        raise MjplugError(f"steps is {steps}; it must be an integer from 0 to {_MAX_STEPS}")
    return count
