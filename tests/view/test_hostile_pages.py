"""Clients of the relay that do harm: the relay goes on, with bounded memory, and so does every other page."""

import contextlib
import hashlib
import json
import random
import resource
import socket
import struct
import threading
import time
import urllib.request

import pytest
from view.page_client import FRAME
from waits import until
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from mjplug.view import relay as relays
from mjplug.view import viewer

HANDSHAKE = (
    "GET /socket HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
    "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n\r\n"
)


@pytest.fixture
def attacked(new_server, new_relay, new_page):
    """A relay with a page that must go on to work."""
    server, relay = new_server(), new_relay()
    page = new_page(relay)
    if not page.hello["servers"]:
        page.text("servers")
    page.do(op="watch", server=0)
    page.text("info")
    server.matched("mjplug/@view/frame")
    yield relay, server
    server.frame(b"still here")
    assert page.item(FRAME, lambda item: item.payload == b"still here")
    assert page.do(op="topics") == {"topics": [], "services": []}


def raw(relay):
    return socket.create_connection(("127.0.0.1", relay.port), timeout=20)


def upgraded(relay):
    """A WebSocket without a library."""
    connection = raw(relay)
    connection.sendall(HANDSHAKE.format(port=relay.port).encode())
    assert connection.recv(12) == b"HTTP/1.1 101"
    return connection


def closed(connection, within=20.0):
    """Whether the other end closes the connection."""
    connection.settimeout(within)
    try:
        while connection.recv(1 << 16):
            pass
    except TimeoutError:
        return False
    except OSError:
        pass
    return True


@pytest.mark.parametrize(
    "garbage",
    [
        b"\0" * 100 + b"\n", b"GET /\n\n", b"GET / HTTP/9.9\r\n\r\n", b"\x16\x03\x01\x02\0\x01\0\x01\xfc\x03\x03\n\n",
        b"GET /" + b"a" * 9000 + b" HTTP/1.1\r\n\r\n", b"GET / HTTP/1.1\r\n" + b"X: y\r\n" * 200 + b"\r\n",
        b"POST / HTTP/1.1\r\nContent-Length: 99999999999\r\n\r\n",
        b"GET / HTTP/1.1\r\nTransfer-Encoding: chunked\r\n\r\n",
        "GET /ü HTTP/1.1\r\n\r\n".encode(), b"GET http://[ HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n",
        b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nHost: evil.com\r\n\r\n",
    ],
)  # fmt: skip
def test_garbage_instead_of_http_ends_the_connection(attacked, garbage):
    relay, _ = attacked
    with raw(relay) as connection:
        connection.sendall(garbage)
        connection.shutdown(socket.SHUT_WR)
        connection.settimeout(20)
        answer = b""
        with contextlib.suppress(ConnectionError):
            while data := connection.recv(1 << 16):
                answer += data
        assert b" 200 " not in answer.split(b"\r\n")[0]


def test_random_bytes_after_the_upgrade_end_only_that_connection(attacked):
    relay, _ = attacked
    chance = random.Random(5)
    for _ in range(20):
        with upgraded(relay) as connection:
            with contextlib.suppress(ConnectionError):
                connection.sendall(chance.randbytes(500))
                connection.shutdown(socket.SHUT_WR)
            assert closed(connection)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "the message is not JSON"),
        ("{", "the message is not JSON"),
        ("[" * 100_000, "the message is not JSON"),
        ("[]", "the message is not a JSON object in text"),
        (b"{}", "the message is not a JSON object in text"),
        ("null", "the message is not a JSON object in text"),
        ("{}", "op is null; it must be one of: ack, watch,"),
        ('{"op": ["watch"]}', 'op is ["watch"]; it must be one of'),
        ('{"op": "__class__"}', 'op is "__class__"; it must be one of'),
        (json.dumps({"op": "x" * 1000}), "… (1002 characters); it must be one of"),
        ('{"op": "watch", "server": {"a": 1}}', 'server is {"a": 1}; there are: 0 (/mjplug)'),
        ('{"op": "watch", "server": false}', "server is false; there are"),
        ('{"op": "watch", "server": NaN}', "server is NaN; there are"),
        ('{"op": "ack", "batch": 1e999}', "batch is Infinity; it must be the number of a batch"),
        ('{"op": "overlay", "server": 0, "kind": ["contacts"]}', 'kind is ["contacts"]; it must be one of'),
        ('{"op": "subscribe", "topic": "\\u0000", "mode": "all"}', "is not a valid ROS name"),
        ('{"op": "subscribe", "topic": "/**", "mode": "all"}', "is not a valid ROS name"),
        ('{"op": "drag", "server": 0, "body": 1, "target": [1e999, 0, 0]}', "it must be a list of 3 numbers"),
        (
            json.dumps({"op": "drag", "server": 0, "body": 1, "target": [10**400, 0, 0]}),
            "it must be a list of 3 numbers below 1e+10",
        ),
        ('{"op": "definition", "type": "a"}', "unknown type 'a'"),
    ],
)
def test_a_message_that_cannot_be_used_gets_a_sentence_and_the_connection_stays(attacked, new_page, text, reason):
    relay, _ = attacked
    page = new_page(relay)
    page.socket.send(text)
    assert reason in page.text("error")["error"]
    assert page.do(op="topics") == {"topics": [], "services": []}


def test_a_message_above_the_limit_ends_the_connection_with_a_reason(attacked, new_page):
    relay, _ = attacked
    page = new_page(relay)
    with pytest.raises(ConnectionClosed) as ended:  # noqa: PT012
        page.socket.send("x" * (relays.MAX_MESSAGE + 1))
        while True:
            page.socket.recv(20)
    assert ended.value.rcvd.code == 1009


def test_a_frame_that_announces_a_huge_length_ends_the_connection(attacked):
    relay, _ = attacked
    with upgraded(relay) as connection:
        connection.sendall(b"\x81\xff" + struct.pack(">Q", 1 << 62) + b"mask" + b"x" * 100)
        assert closed(connection)


def test_a_flood_of_requests_is_answered_or_ends_but_never_grows(attacked):
    relay, _ = attacked
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    message = json.dumps({"op": "definition", "type": "sensor_msgs/msg/JointState", "id": 1}).encode()
    frame = b"\x81" + bytes([0x80 | len(message)]) + b"\0\0\0\0" + message
    with upgraded(relay) as connection:
        connection.settimeout(1.0)
        sent = 0
        # It never reads, so after some time it can neither write nor stay.
        with contextlib.suppress(OSError):
            while sent < 50_000:
                connection.sendall(frame * 100)
                sent += 100
    # A MacBook counts in bytes.
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 200_000


def test_a_client_that_never_reads_is_disconnected(attacked, monkeypatch):
    monkeypatch.setattr(viewer, "MAX_TEXTS", 50)
    relay, server = attacked
    with upgraded(relay) as connection:
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1024)
        ended = threading.Event()

        def change():
            server.info["padding"] = "x" * 100_000
            watch = json.dumps({"op": "watch", "server": 0, "on": True}).encode()
            connection.sendall(b"\x81" + bytes([0x80 | len(watch)]) + b"\0\0\0\0" + watch)
            while not ended.wait(0.005):
                server.info["step"] = time.monotonic()
                server.publisher("mjplug/@view/info").put(json.dumps(server.info))

        thread = threading.Thread(target=change)
        thread.start()
        try:
            until(lambda: len(relay.relay.viewers) == 1)
        finally:
            ended.set()
            thread.join()


def test_a_client_that_sends_its_request_slowly_is_disconnected(attacked, monkeypatch):
    relay, _ = attacked
    relay.relay.limits.patience = 0.3
    with raw(relay) as connection:
        began = time.monotonic()
        with contextlib.suppress(OSError):
            for letter in HANDSHAKE:
                connection.sendall(letter.encode())
                time.sleep(0.02)
        assert closed(connection)
        assert time.monotonic() - began < 15.0


def test_a_client_that_pings_without_reading_is_disconnected(attacked):
    relay, _ = attacked
    relay.relay.limits.max_echo = 10_000
    with upgraded(relay) as connection:
        connection.settimeout(20)
        with pytest.raises(OSError, match=r"reset|[Bb]roken pipe"):  # noqa: PT012
            for _ in range(100_000):
                connection.sendall((b"\x89\xfd\0\0\0\0" + b"x" * 125) * 1000)


def test_a_client_that_reads_nothing_of_a_large_response_is_disconnected(new_server, new_relay, new_page):
    chance = random.Random(1)
    # Larger than the buffers of the kernel, also after compression.
    server, relay = new_server(pack=chance.randbytes(20_000_000)), new_relay()
    relay.relay.limits.patience = 0.3
    page = new_page(relay)
    if not page.hello["servers"]:
        page.text("servers")
    page.do(op="watch", server=0)
    page.text("info")
    with contextlib.ExitStack() as stack:
        for _ in range(20):
            connection = stack.enter_context(raw(relay))
            connection.sendall(f"GET /scene/{server.hash} HTTP/1.1\r\nHost: 127.0.0.1:{relay.port}\r\n\r\n".encode())
        # The page and nobody else; the last ones wait until the first ones have been disconnected.
        until(lambda: relay.relay.limits.count == 1)
    with urllib.request.urlopen(f"{relay.url}scene/{server.hash}") as response:
        assert hashlib.sha256(response.read()).hexdigest() == server.hash


def test_too_many_browsers_are_refused_with_a_sentence(attacked, new_page, monkeypatch):
    monkeypatch.setattr(relays, "MAX_VIEWERS", 3)
    relay, _ = attacked
    pages = [new_page(relay) for _ in range(2)]
    with connect(f"ws://127.0.0.1:{relay.port}/socket") as refused:
        assert json.loads(refused.recv(20))["error"] == "3 browsers are connected, which is the maximum"
        with pytest.raises(ConnectionClosed) as ended:
            refused.recv(20)
    assert ended.value.rcvd.code == 1013
    pages[0].close()
    until(lambda: len(relay.relay.viewers) == 2)
    new_page(relay)


def test_too_many_connections_are_closed_and_the_others_work(attacked, monkeypatch):
    relay, _ = attacked
    relay.relay.limits.max_count = 20
    with contextlib.ExitStack() as stack:
        connections = [stack.enter_context(raw(relay)) for _ in range(40)]
        assert sum(closed(connection, 1.0) for connection in connections[20:]) >= 20
    until(lambda: relay.relay.limits.count <= 1)
    with raw(relay) as connection:
        connection.sendall(f"GET / HTTP/1.1\r\nHost: 127.0.0.1:{relay.port}\r\n\r\n".encode())
        assert connection.recv(12) == b"HTTP/1.1 200"


def test_connections_that_end_without_a_word_leave_nothing_behind(attacked, new_page):
    relay, _ = attacked
    for _ in range(10):
        with upgraded(relay) as connection:
            watch = json.dumps({"op": "watch", "server": 0, "on": True}).encode()
            connection.sendall(b"\x81" + bytes([0x80 | len(watch)]) + b"\0\0\0\0" + watch)
            # Resets the connection instead of closing it.
            connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    until(lambda: len(relay.relay.viewers) == 1 and relay.relay.limits.count == 1)
