"""A TCP link that carries only so much, from the server to a client."""

import socket
import threading
import time

_PIECE = 16384


class NarrowLink:
    """Passes on what comes to `endpoint`.

    Args:
        port: Where the server listens on 127.0.0.1.
        rate: What the client may get [bytes/s].
    """

    def __init__(self, port, rate):
        self._port, self._rate = port, rate
        self._listening = socket.create_server(("127.0.0.1", 0))
        self._listening.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4 * _PIECE)
        self.endpoint = f"tcp/127.0.0.1:{self._listening.getsockname()[1]}"
        threading.Thread(target=self._accept, daemon=True).start()

    def close(self):
        self._listening.close()

    def _accept(self):
        try:
            client, _ = self._listening.accept()
        except OSError:
            return
        server = socket.socket()
        server.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4 * _PIECE)
        server.connect(("127.0.0.1", self._port))
        threading.Thread(target=_pass_on, args=(client, server, 0.0), daemon=True).start()
        threading.Thread(target=_pass_on, args=(server, client, 1.0 / self._rate), daemon=True).start()


def _pass_on(source, sink, seconds_per_byte):
    try:
        while piece := source.recv(_PIECE):
            sink.sendall(piece)
            time.sleep(len(piece) * seconds_per_byte)
    except OSError:
        pass
    finally:
        source.close()
        sink.close()
