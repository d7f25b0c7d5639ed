"""Ports and addresses of the page, and the way from Zenoh's threads to the event loop."""

import asyncio
import socket
import threading

import pytest
from view import coroutines

from mjplug.errors import WireError
from mjplug.view.handoff import Handoff
from mjplug.view.listening import listen


def test_a_busy_port_gives_way_to_a_free_one_unless_it_must_be_this_one():
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        listening = listen("127.0.0.1", port)
        assert listening.port != port
        with socket.create_connection(("127.0.0.1", listening.port), timeout=5):
            pass
        listening.close()
        with pytest.raises(
            WireError, match=f"port {port} is in use; choose another one with --port, or 0 for any free"
        ):
            listen("127.0.0.1", port, search=False)


@pytest.mark.parametrize("host", ["192.0.2.1", "no-such-host.invalid", "a b"])
def test_an_address_of_no_interface_is_refused_with_its_name(host):
    with pytest.raises(WireError, match=f"cannot listen on {host}"):
        listen(host, 0)


@pytest.mark.parametrize(
    ("host", "loopback", "start"),
    [
        ("127.0.0.1", True, "http://127.0.0.1:"),
        ("localhost", True, "http://localhost:"),
        ("0.0.0.0", False, f"http://{socket.gethostname()}:"),
        ("[::1]", True, "http://[::1]:"),
        ("::", False, f"http://{socket.gethostname()}:"),
    ],
)
def test_the_url_is_for_a_browser(host, loopback, start):
    if ":" in host and not _has_ipv6():
        pytest.skip("this machine has no IPv6")
    listening = listen(host, 0)
    try:
        assert listening.loopback is loopback
        assert listening.url(None) == f"{start}{listening.port}/"
        assert listening.url("abc") == f"{start}{listening.port}/?token=abc"
        assert {each.getsockname()[1] for each in listening.sockets} == {listening.port}
    finally:
        listening.close()


def test_a_flood_from_another_thread_wakes_the_event_loop_once():
    wakes, done = [], []

    async def run():
        loop = asyncio.get_running_loop()

        class Counting:
            def call_soon_threadsafe(self, action):
                wakes.append(action)
                loop.call_soon_threadsafe(action)

        handoff = Handoff(Counting())
        for _ in range(3):
            before = len(done)
            # The loop is busy meanwhile.
            thread = threading.Thread(target=lambda: [handoff.post(lambda: done.append(1)) for _ in range(1000)])
            thread.start()
            thread.join()
            while len(done) < before + 1000:
                await asyncio.sleep(0)

    coroutines.run(run())
    assert (len(wakes), len(done)) == (3, 3000)


def _has_ipv6():
    try:
        with socket.create_server(("::1", 0), family=socket.AF_INET6):
            return True
    except OSError:
        return False
