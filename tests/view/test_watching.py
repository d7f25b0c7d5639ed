"""Servers, descriptions, frames, overlays and their pace."""

import json

import pytest
from view.page_client import FRAME, OVERLAY

from mjplug.view import viewer
from mjplug.view.watching import OVERLAYS


def test_the_page_gets_the_servers_the_description_and_then_frames(new_server, page):
    server = new_server()
    page.text("servers", lambda text: text["servers"][0]["connected"])
    assert (page.hello["protocol"], page.hello["read_only"]) == (1, False)
    assert page.nothing()
    page.do(op="watch", server=0, on=True)
    info = page.text("info")
    assert (info["server"], info["info"]) == (0, server.info)
    server.matched("mjplug/@view/frame")
    server.frame(b"frame 1")
    item = page.item(FRAME)
    assert (item.server, item.channel, item.batch, item.payload) == (0, 0, 1, b"frame 1")


def test_a_change_of_the_description_is_passed_on(new_server, watching):
    server, page = watching
    server.info["paused"] = True
    server.publisher("mjplug/@view/info").put(json.dumps(server.info))
    assert page.text("info")["info"]["paused"] is True


def test_a_second_page_gets_the_description_without_a_query(new_server, new_relay, new_page):
    server, relay = new_server(), new_relay()
    first, second = new_page(relay), new_page(relay)
    for page in (first, second):
        page.text("servers") if not page.hello["servers"] else None
        page.do(op="watch", server=0)
        page.text("info")
    assert server.queried["mjplug/@view/info"] == 1


def test_an_unknown_server_is_refused_with_those_that_exist(watching):
    _, page = watching
    assert page.refused(op="watch", server=7, on=True) == "server is 7; there are: 0 (/mjplug)"
    assert page.refused(op="watch", server=0, on=1) == "on is 1; it must be true or false"


def test_two_batches_at_most_are_on_their_way_and_the_page_gets_the_newest(new_server, new_relay, new_page):
    server = new_server()
    page = new_page(new_relay(), acknowledges=False)
    _watch(page, server)
    for number in range(4):
        server.frame(b"frame %d" % number)
        if number < 2:
            assert page.item(FRAME).payload == b"frame %d" % number
    assert page.nothing()
    page.acknowledge(1)
    item = page.item(FRAME)
    assert (item.batch, item.payload) == (3, b"frame 3")


def test_an_acknowledgement_of_a_batch_that_was_never_sent_opens_nothing(new_server, new_relay, new_page):
    server = new_server()
    page = new_page(new_relay(), acknowledges=False)
    _watch(page, server)
    page.do(op="ack", batch=10**9)
    for number in range(3):
        server.frame(b"frame %d" % number)
        if number < 2:
            page.item(FRAME)
    assert page.nothing()
    assert page.refused(op="ack", batch=-1) == "batch is -1; it must be the number of a batch"


def test_an_overlay_is_subscribed_to_while_it_is_wanted(watching):
    server, page = watching
    page.do(op="overlay", server=0, kind="tendons", on=True)
    server.matched("mjplug/@view/overlay/tendons")
    server.publisher("mjplug/@view/overlay/tendons").put(b"shapes")
    item = page.item(OVERLAY)
    assert (item.channel, item.payload) == (2, b"shapes")
    page.do(op="overlay", server=0, kind="tendons", on=False)
    server.unmatched("mjplug/@view/overlay/tendons")
    assert page.refused(op="overlay", server=0, kind="wings").startswith('kind is "wings"; it must be one of: con')


def test_the_kinds_of_overlays_are_those_of_the_server():
    from mjplug.services.view.overlays import KINDS

    assert tuple(KINDS) == OVERLAYS


def test_a_key_has_one_subscription_and_none_when_the_last_page_has_left(new_server, new_relay, new_page):
    server, relay = new_server(), new_relay()
    pages = [new_page(relay) for _ in range(3)]
    for page in pages:
        _watch(page, server)
    feeds = relay.relay.network.feeds
    assert sorted(feeds.keys) == ["mjplug/@view/frame", "mjplug/@view/info"]
    pages[0].close()
    pages[1].do(op="watch", server=0, on=False)
    server.frame(b"frame")
    assert pages[2].item(FRAME).payload == b"frame"
    pages[2].close()
    server.unmatched("mjplug/@view/frame")
    server.unmatched("mjplug/@view/info")


def test_a_page_that_does_not_acknowledge_costs_the_server_nothing_until_it_does(
    new_server, new_relay, new_page, monkeypatch
):
    monkeypatch.setattr(viewer, "SUSPEND_AFTER", 0.5)
    server = new_server(topics={"/clock": "rosgraph_msgs/msg/Clock"})
    page = new_page(new_relay(), acknowledges=False)
    _watch(page, server)
    page.do(op="subscribe", topic="/clock", mode="newest")
    server.matched("clock")
    for number in range(3):
        server.frame(b"frame %d" % number)
        if number < 2:
            page.item(FRAME)
    server.unmatched("mjplug/@view/frame")
    server.unmatched("clock")
    page.acknowledge(2)
    server.matched("mjplug/@view/frame")
    server.matched("clock")
    page.item(FRAME, lambda item: item.payload == b"frame 2")


def test_several_servers_have_their_own_frames_and_node_chooses_among_them(new_server, new_relay, new_page):
    robots = [new_server(f"/robot{number}/mjplug") for number in range(3)]
    page = new_page(new_relay(nodes=["/robot1/mjplug", "/robot2/mjplug"]))
    known = page.hello["servers"]
    while len(known) < 2 or not all(each["connected"] for each in known):
        known = page.text("servers")["servers"]
    ids = {each["name"]: each["id"] for each in known}
    assert sorted(ids) == ["/robot1/mjplug", "/robot2/mjplug"]
    for number in (1, 2):
        page.do(op="watch", server=ids[f"/robot{number}/mjplug"], on=True)
        page.text("info")
        robots[number].matched(f"robot{number}/mjplug/@view/frame")
        robots[number].frame(b"frame of %d" % number)
        item = page.item(FRAME)
        assert (item.server, item.payload) == (ids[f"/robot{number}/mjplug"], b"frame of %d" % number)


def test_a_server_that_returns_with_another_model_keeps_its_id_and_sends_the_new_hash_first(
    new_server, watching, new_page
):
    server, page = watching
    server.stop()
    page.text("servers", lambda text: not text["servers"][0]["connected"])
    again = new_server(pack=b"another model")
    assert again.hash != server.hash
    page.text("servers", lambda text: text["servers"][0] == {"id": 0, "name": "/mjplug", "connected": True})
    again.matched("mjplug/@view/frame")
    assert page.text("info")["info"]["scene"] == again.hash
    again.frame(b"frame of the new model")
    assert page.item(FRAME).payload == b"frame of the new model"


def test_frames_that_arrive_before_the_description_are_dropped(new_server, new_relay, new_page):
    server = new_server()
    description = server.info.copy()
    server.info.pop("scene")
    page = new_page(new_relay())
    _await_server(page)
    page.do(op="watch", server=0, on=True)
    server.matched("mjplug/@view/frame")
    server.frame(b"frame of an unknown model")
    assert page.nothing()
    server.publisher("mjplug/@view/info").put(json.dumps(description))
    page.text("info")
    server.frame(b"frame")
    assert page.item(FRAME).payload == b"frame"


@pytest.fixture
def watching(new_server, page):
    """A server that publishes /cmd, and a page that watches it."""
    server = new_server()
    _watch(page, server)
    return server, page


def _await_server(page):
    if not (page.hello["servers"] and page.hello["servers"][0]["connected"]):
        page.text("servers", lambda text: text["servers"] and text["servers"][0]["connected"])


def _watch(page, server):
    _await_server(page)
    page.do(op="watch", server=0, on=True)
    page.text("info")
    server.matched("mjplug/@view/frame")
