"""Relays, servers without physics, pages without a browser, and Chromium."""

import os
import shutil
from contextlib import ExitStack
from dataclasses import dataclass

import pytest
import zenoh
from view.fake_server import FakeServer
from view.page_client import Page
from view.studio import PAGE, Server, Studio

from mjplug.client import Client
from mjplug.view.background import BackgroundRelay
from mjplug.view.built_page import BuiltPage
from mjplug.view.listening import listen
from mjplug.view.relay import Options
from mjplug.wire.session import SessionSettings, open_router

CHROMIUM = "/usr/bin/chromium"
ARGUMENTS = ["--no-sandbox", "--disable-dev-shm-usage"]


@pytest.fixture
def opened():
    """Closes what a test opens, in reverse."""
    with ExitStack() as stack:

        def keep(closeable, close="close"):
            stack.callback(getattr(closeable, close))
            return closeable

        yield keep


@pytest.fixture
def router(opened):
    """The endpoint of a Zenoh router."""
    return opened(open_router(SessionSettings("router", ("tcp/127.0.0.1:0",)))).endpoint


@pytest.fixture
def new_server(opened, router):
    """Starts servers without physics."""
    return lambda *args, **options: opened(FakeServer(router, *args, **options), "stop")


@pytest.fixture
def built(tmp_path):
    """A built page."""
    folder = tmp_path / "built"
    (folder / "fonts").mkdir(parents=True)
    (folder / "index.html").write_text("<!doctype html><title>mjplug</title>")
    (folder / "page.js").write_text("// page\n" * 1000)
    (folder / "fonts" / "a.woff2").write_bytes(b"\0font")
    (tmp_path / "secret.txt").write_text("secret")
    return folder


@dataclass
class Running:
    url: str
    port: int
    relay: object
    close: object


@pytest.fixture
def new_relay(opened, router, built):
    """Starts relays in this process."""

    def start(host="127.0.0.1", **options):
        client = opened(_client(router))
        listening = listen(host, 0)
        background = opened(BackgroundRelay(client.session, listening, Options(**options), BuiltPage(built)))
        return Running(listening.url(None), listening.port, background.relay, background.close)

    return start


@pytest.fixture
def new_page(opened):
    """Opens pages."""
    return lambda relay, **options: opened(Page(relay.url, **options))


@pytest.fixture
def page(new_relay, new_page):
    return new_page(new_relay())


def _client(endpoint):
    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", f'["{endpoint}"]')
    config.insert_json5("scouting/multicast/enabled", "false")
    return Client(zenoh.open(config), endpoint)


def unavailable(reason):
    """Skips a test, or lets it fail where everything has to be there."""
    if os.environ.get("CI"):
        pytest.fail(f"{reason}, but CI is set")
    pytest.skip(reason)


@pytest.fixture(scope="session")
def playwright():
    """Playwright; one for all tests of a process, because it cannot be started twice."""
    if not shutil.which(CHROMIUM):
        unavailable(f"{CHROMIUM} is missing (apt-get install chromium)")
    if not (PAGE / "page.js").exists():
        unavailable("the page is not built (make page)")
    from playwright.sync_api import sync_playwright

    with sync_playwright() as running:
        yield running


@pytest.fixture(scope="session")
def browser(playwright):
    """Chromium without a window; one for all tests of a process."""
    chromium = playwright.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
    yield chromium
    chromium.close()


@pytest.fixture
def studio(browser):
    """Opens the page with models; the page must report no error and ask no other host."""
    opened = []

    def open_studio(*models, **arguments):
        servers = [m if isinstance(m, Server) else Server(m, name=f"/robot{i}/mjplug") for i, m in enumerate(models)]
        opened.append(Studio(browser, servers, **arguments))
        return opened[-1]

    yield open_studio
    for page in opened:
        page.close()
    assert [error for page in opened for error in page.errors] == []
    assert [url for page in opened for url in page.foreign] == []
