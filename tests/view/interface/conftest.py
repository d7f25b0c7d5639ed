"""Servers, relays and pages in Chromium."""

import pytest
from view.interface import live
from view.interface.toys import OTHER, TOYS
from waits import TIMEOUT


@pytest.fixture(scope="package")
def folder(tmp_path_factory):
    """A folder with the models."""
    folder = tmp_path_factory.mktemp("models")
    (folder / "toys.xml").write_text(TOYS)
    (folder / "other.xml").write_text(OTHER)
    return folder


@pytest.fixture(scope="module")
def running(folder):
    """A server and a relay that the tests of a module share."""
    server = live.Served("toys.xml", *live.STATES, cwd=folder)
    view = live.View(server.endpoint, cwd=folder)
    simulation = live.Simulation(server.endpoint)
    yield simulation, view
    simulation.close()
    view.kill()
    server.kill()


@pytest.fixture
def simulation(running):
    """The server, reset, running and at real time."""
    simulation, _ = running
    simulation.call("~/set_pause", paused=False)
    simulation.call("~/set_parameters", parameters=[{"name": "sim.speed", "value": {"type": 3, "double_value": 1.0}}])
    simulation.call("~/reset_world")
    return simulation


@pytest.fixture
def open_page(browser, running):
    """Opens pages; a page raises no errors and asks no other host."""
    contexts = []

    def open_page(url=running[1].url, size=(800, 500), **options):
        # Playwright evaluates text, which the page's own policy forbids.
        context = browser.new_context(
            viewport={"width": size[0], "height": size[1]}, bypass_csp=True, color_scheme="dark", **options
        )
        context.set_default_timeout(1000 * TIMEOUT)
        page = context.new_page()
        errors, requests = [], []
        page.on("pageerror", lambda error: errors.append(error.stack))
        page.on("request", lambda request: requests.append(request.url))
        page.goto(url)
        contexts.append((context, url, errors, requests))
        return page

    yield open_page
    for context, url, errors, requests in contexts:
        context.close()
        assert errors == []
        assert [request for request in requests if not request.startswith((url, "data:", "blob:"))] == []


@pytest.fixture
def page(simulation, open_page):
    """A page that shows the model."""
    return shown(open_page())


def shown(page):
    """Waits until a page shows a model, and returns it."""
    page.wait_for_function("window.mjplug?.app.servers.frame != null")
    return page
