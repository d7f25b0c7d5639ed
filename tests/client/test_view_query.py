"""Queries for what a server makes at the first query, while it is starting, and when it has no answer."""

import threading

import pytest
import zenoh
from zenoh.handlers import Callback

from mjplug.client import view_query
from mjplug.client.errors import ClientError, TimedOutError

KEY = "lab/sim/@view/info"


@pytest.fixture
def session():
    config = zenoh.Config()
    config.insert_json5("listen/endpoints", "[]")
    config.insert_json5("scouting/multicast/enabled", "false")
    with zenoh.open(config) as opened:
        yield opened


def declare(session, answer):
    def receive(query):
        with query:
            answer(query)

    return session.declare_queryable(KEY, Callback(receive, indirect=False))


def test_a_server_that_answers_later_is_queried_again(session):
    queried, kept = threading.Event(), []
    early = declare(session, lambda query: queried.set())

    def start():
        queried.wait(20.0)
        early.undeclare()
        kept.append(declare(session, lambda query: query.reply(KEY, b"info")))

    starting = threading.Thread(target=start)
    starting.start()
    assert bytes(view_query.query(session, KEY, 20.0).payload) == b"info"
    starting.join()


def test_a_refusal_is_final(session):
    asked = []
    kept = declare(session, lambda query: (asked.append(1), query.reply_err(b"no memory")))
    with pytest.raises(ClientError, match=r"^no memory$"):
        view_query.query(session, KEY, 20.0)
    assert asked == [1]
    kept.undeclare()


def test_a_key_on_which_nobody_answers_is_reported(session, monkeypatch):
    monkeypatch.setattr(view_query, "NO_REPLY_TIME", 0.1)
    with pytest.raises(TimedOutError, match="nobody answers on lab/sim/@view/info; its server may have stopped"):
        view_query.query(session, KEY, 20.0)


def test_a_server_that_is_too_slow_is_reported_as_busy(session):
    held = []
    kept = session.declare_queryable(KEY, Callback(held.append, indirect=False))
    with pytest.raises(TimedOutError, match=r"no answer from lab/sim/@view/info within 0\.3 s; its server may be busy"):
        view_query.query(session, KEY, 0.3)
    kept.undeclare()
