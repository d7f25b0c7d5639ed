"""Servers that answer late: they are starting, their machine is busy, or the network was interrupted."""

import asyncio
import gzip
import json
import threading
import urllib.request
from concurrent.futures import ThreadPoolExecutor

import pytest
from view import coroutines

from mjplug.client.errors import TimedOutError
from mjplug.view import permission, queries, scenes, watching
from mjplug.view.remote_server import Server
from mjplug.wire.discovery import announced

INFO, SCENE = "mjplug/@view/info", "mjplug/@view/scene"


@pytest.fixture
def late(new_server):
    """A server that is announced, but answers no queries yet."""
    return new_server(answers=False)


@pytest.fixture
def new_watching_page(late, new_relay, new_page):
    relay = new_relay()

    def start():
        page = new_page(relay)
        if not page.hello["servers"]:
            page.text("servers")
        page.do(op="watch", server=0)
        return page

    start.relay = relay
    return start


def test_a_server_that_is_announced_before_it_answers_is_shown_without_an_error(late, new_watching_page):
    page = new_watching_page()
    # The first queries end without a reply.
    assert page.nothing(1.0)
    late.answer()
    assert page.text("info")["info"] == late.info
    assert page.texts == []


def test_a_server_that_does_not_answer_for_long_is_reported_to_every_page_until_it_does(
    late, new_watching_page, monkeypatch
):
    monkeypatch.setattr(watching, "_QUIET", 0.2)
    pages = [new_watching_page()]
    reported = [pages[0].text("error")["error"]]
    # This page comes after the report.
    pages.append(new_watching_page())
    reported.append(pages[1].text("error")["error"])
    assert reported[0] == reported[1]
    assert reported[0].startswith(f"/mjplug is not shown yet; the view asks again: {INFO} did not answer")
    late.answer()
    for page in pages:
        assert page.text("info")["info"] == late.info


def test_the_reason_why_a_server_cannot_be_shown_is_reported_at_once(late, new_watching_page):
    def refuse(query):
        raise ValueError("the drawing pack cannot be made: no memory")

    late.answer(refuse)
    reason = "/mjplug cannot be shown: the drawing pack cannot be made: no memory"
    assert new_watching_page().text("error")["error"] == reason


def test_a_timeout_that_zenoh_reports_is_not_taken_for_a_refusal(late):
    def expire(query):
        raise ValueError("Timeout")

    late.answer(expire)
    with pytest.raises(TimedOutError, match=f"no answer from {INFO} within 20 s"):
        coroutines.run(queries.ask(late.session, INFO, 20.0))


def test_a_description_that_is_published_during_the_query_is_not_replaced_by_the_reply(late, new_watching_page):
    page, published = new_watching_page(), threading.Event()

    def newer_first(query):
        late.publisher(INFO).put(json.dumps(late.info | {"paused": True}))
        page.text("info", lambda text: text["info"]["paused"])
        published.set()
        return json.dumps(late.info).encode()

    late.answer(newer_first)
    assert published.wait(20.0)
    assert page.nothing()
    assert [text for text in page.texts if text["op"] == "info"] == []


def test_a_scene_that_is_not_sent_is_queried_again_and_the_page_waits(late, new_watching_page, monkeypatch):
    monkeypatch.setattr(scenes, "_RETRY", 0.1)
    pack, late.pack = late.pack, None
    late.answer()
    new_watching_page().text("info")
    with ThreadPoolExecutor(1) as other:
        loading = other.submit(urllib.request.urlopen, f"{new_watching_page.relay.url}scene/{late.hash}", timeout=20)
        late.wait_for_queries(SCENE, 3)
        late.pack = pack
        assert gzip.decompress(loading.result(20).read()) == b"pack"


def test_a_service_of_a_server_that_does_not_answer_is_not_called_unknown_without_a_hint(late, new_watching_page):
    refused = new_watching_page().refused(op="call", service="~/set_pause", server=0)
    assert refused.startswith("unknown service '/mjplug/set_pause'")
    assert "announced, but not answering: /mjplug" in refused


def test_a_list_of_interfaces_that_changes_during_the_query_is_queried_again(late):
    late.answer()

    async def query_twice():
        server = Server(0, "/mjplug")
        server._changes = late
        listed = asyncio.create_task(server.interfaces(late.session, None))
        await asyncio.sleep(0)
        server.forget()
        await listed
        await server.interfaces(late.session, None)
        await server.interfaces(late.session, None)

    coroutines.run(query_twice())
    assert late.queried[announced.interfaces_key("/mjplug")] == 2


def test_a_refusal_of_commands_is_checked_again_after_a_while(new_server, new_relay, new_page, monkeypatch):
    monkeypatch.setattr(permission, "_ASK_AGAIN", 0.1)
    server = new_server()
    server.permits = False
    page = new_page(new_relay())
    if not page.hello["servers"]:
        page.text("servers")
    drag = {"op": "drag", "server": 0, "body": 1, "target": [0, 0, 1]}
    assert "permits this view only to look" in page.refused(**drag)
    server.permits = True
    for _ in range(100):
        if page.ask(**drag)["ok"]:
            break
        page.nothing(0.1)
    assert server.wait_for("mjplug/@view/drag")
