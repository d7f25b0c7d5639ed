"""A TCP listener in front of a server that passes on each connection late, as on a busy machine."""

import contextlib
import socket
import threading


class SlowListener:
    """Passes on the bytes of each connection, the first of them after a delay.

    Attributes:
        endpoint: Where it listens.
        connections: How many connections it has accepted.
    """

    def __init__(self, endpoint, delay=0.0, port=0):
        host, _, server_port = endpoint.removeprefix("tcp/").rpartition(":")
        self._server, self._delay = (host, int(server_port)), delay
        self._closing = threading.Event()
        self._sockets = []
        self._listener = socket.create_server(("127.0.0.1", port))
        self.endpoint = f"tcp/127.0.0.1:{self._listener.getsockname()[1]}"
        self.connections = 0
        threading.Thread(target=self._accept, daemon=True).start()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._closing.set()
        for each in (self._listener, *self._sockets):
            with contextlib.suppress(OSError):
                each.shutdown(socket.SHUT_RDWR)
            each.close()

    def _accept(self):
        # The listener is closed at the end.
        with contextlib.suppress(OSError):
            while True:
                accepted, _ = self._listener.accept()
                self.connections += 1
                self._sockets.append(accepted)
                threading.Thread(target=self._pass_on, args=(accepted,), daemon=True).start()

    def _pass_on(self, accepted):
        if self._closing.wait(self._delay):
            return
        with contextlib.suppress(OSError):
            server = socket.create_connection(self._server)
            self._sockets.append(server)
            back = threading.Thread(target=self._copy, args=(server, accepted), daemon=True)
            back.start()
            self._copy(accepted, server)

    @staticmethod
    def _copy(source, target):
        with contextlib.suppress(OSError):
            while data := source.recv(1 << 16):
                target.sendall(data)
            target.shutdown(socket.SHUT_WR)
