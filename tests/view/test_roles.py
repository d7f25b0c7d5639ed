"""The view of a server with roles."""

import pytest
from cli.process import Served
from view.page_client import FRAME, Page

from mjplug.client import connect
from mjplug.security.folder import KeyFolder
from mjplug.view.background import BackgroundRelay
from mjplug.view.built_page import BuiltPage
from mjplug.view.listening import listen
from mjplug.view.relay import Options


@pytest.fixture(scope="module")
def secured(tmp_path_factory):
    folder = KeyFolder.create(tmp_path_factory.mktemp("roles") / "keys", ["localhost"])
    server = Served(
        "bundled:box", "--zenoh-config", str(folder.path / "server" / "server.json5"),
        cwd=folder.path.parent, listen=("--listen", "tls/localhost:0"),
    )  # fmt: skip
    yield server, folder.path
    assert server.stop() == 0


@pytest.fixture
def page_of(secured, opened, built):
    """Opens the page of a view with the key of a role."""
    server, keys = secured

    def open_page(role):
        client = opened(connect(server.endpoint, config=keys / f"{role}.json5", timeout=20.0))
        listening = listen("127.0.0.1", 0)
        opened(BackgroundRelay(client.session, listening, Options(), BuiltPage(built)))
        page = opened(Page(listening.url(None)))
        if not page.hello["servers"]:
            page.text("servers")
        return page

    return open_page


def test_a_viewer_looks_and_is_told_that_drags_are_refused(page_of):
    page = page_of("viewer")
    page.do(op="watch", server=0)
    page.text("info")
    page.item(FRAME)
    assert page.do(op="topics")["topics"]
    page.do(op="subscribe", topic="/clock", mode="newest")
    sentence = "/mjplug permits this view only to look: its access rules give the client of `mjplug view` the role of a"
    assert page.refused(op="drag", server=0, body=1, target=[0, 0, 3]).startswith(sentence)
    assert "does not permit this client" in page.refused(op="call", service="~/set_pause", request={"paused": True})


def test_an_operator_drags_and_commands(page_of):
    page = page_of("operator")
    page.do(op="drag", server=0, body=1, target=[0, 0, 3])
    page.do(op="drag", server=0, release=True)
    assert page.do(op="call", service="~/set_pause", request={"paused": False})["success"] is True
