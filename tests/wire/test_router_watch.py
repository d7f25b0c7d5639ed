"""A server whose router ends, without the processes: those are in tests/cli/test_router.py."""

import logging
import queue
import threading
from contextlib import closing
from types import SimpleNamespace

import pytest
from waits import TIMEOUT

from mjplug.errors import WireError
from mjplug.wire import router_watch
from mjplug.wire.endpoints import on_free_port
from mjplug.wire.router_watch import RouterWatch
from mjplug.wire.session import SessionSettings, open_session


class Info:
    """Replaces Zenoh's information on a session whose router is connected until `gone` is set."""

    def __init__(self):
        self.gone = threading.Event()
        self.seen = threading.Event()

    def routers_zid(self):
        self.seen.set()
        return [] if self.gone.is_set() else ["a router"]

    def peers_zid(self):
        return []


@pytest.fixture
def often(monkeypatch):
    monkeypatch.setattr(router_watch, "_CHECK_PERIOD", 0.01)


def watch(info, host):
    """Looks after a connection whose router goes after it has been seen."""
    made = RouterWatch(SimpleNamespace(info=info), ("tcp/192.0.2.1:7447",), host)
    assert info.seen.wait(TIMEOUT)
    threading.Event().wait(0.05)
    info.gone.set()
    return made


def test_a_router_that_cannot_be_hosted_yet_is_tried_again_and_reported_once(often, caplog):
    info, attempts, hosted, closed = Info(), queue.SimpleQueue(), threading.Event(), []

    def host():
        attempts.put(None)
        if attempts.qsize() < 4:
            raise WireError("cannot listen on tcp/192.0.2.1:7447: no such address")
        hosted.set()
        return SimpleNamespace(close=lambda: closed.append("once"))

    with closing(watch(info, host)) as watched:
        assert hosted.wait(TIMEOUT)
        watched.stop()
    assert attempts.qsize() == 4
    assert closed == ["once"]
    (failure,) = [line for line in caplog.messages if "cannot host a replacement router" in line]
    assert failure.endswith("cannot listen on tcp/192.0.2.1:7447: no such address; trying again")
    assert caplog.messages[-1] == "this server now hosts the Zenoh router at tcp/192.0.2.1:7447"


def test_a_router_that_ends_before_anybody_looked_for_it_is_replaced_too(often):
    info, hosted = Info(), threading.Event()
    info.gone.set()

    def host():
        hosted.set()
        return SimpleNamespace(close=lambda: None)

    with closing(RouterWatch(SimpleNamespace(info=info), ("tcp/192.0.2.1:7447",), host)):
        assert hosted.wait(TIMEOUT)


def test_a_server_that_stops_while_it_takes_over_leaves_no_router(often):
    info, asked, release, closed = Info(), threading.Event(), threading.Event(), threading.Event()

    def host():
        asked.set()
        assert release.wait(TIMEOUT)
        return SimpleNamespace(close=closed.set)

    watched = watch(info, host)
    assert asked.wait(TIMEOUT)
    stopping = threading.Thread(target=watched.close)
    stopping.start()
    release.set()
    stopping.join(TIMEOUT)
    assert not stopping.is_alive()
    assert closed.is_set()


def test_a_server_that_hosts_a_router_for_everybody_reports_it(often, opened, caplog):
    endpoint = on_free_port("tcp/0.0.0.0:0")
    first = opened(open_session(SessionSettings(listen=(endpoint,)), "/first"))
    second = opened(open_session(SessionSettings(listen=(endpoint,)), "/second"))
    assert (first.role, second.role) == ("router", "client")
    caplog.clear()
    reported = queue.SimpleQueue()
    handler = logging.Handler()
    handler.emit = lambda record: reported.put(record.getMessage())
    logging.getLogger("mjplug.wire").addHandler(handler)
    try:
        first.close()
        lines = [reported.get(timeout=TIMEOUT)]
        while "hosts the Zenoh router" not in lines[-1]:
            lines.append(reported.get(timeout=TIMEOUT))
    finally:
        logging.getLogger("mjplug.wire").removeHandler(handler)
    assert [line for line in lines if line.startswith(f"{endpoint} accepts all clients")]
