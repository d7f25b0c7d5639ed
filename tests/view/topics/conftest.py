"""A robot in a room, and pages that show it in Chromium."""

import pytest
from view.interface import live
from view.interface.conftest import shown
from view.topics.robot import CONFIG, XML, Robot
from waits import TIMEOUT


@pytest.fixture(scope="package")
def running(tmp_path_factory):
    """A server and a relay that the tests share."""
    folder = tmp_path_factory.mktemp("room")
    (folder / "room.xml").write_text(XML)
    (folder / "room.yaml").write_text(CONFIG)
    server = live.Served("room.yaml", cwd=folder)
    view = live.View(server.endpoint, cwd=folder)
    robot = Robot(server.endpoint)
    yield robot, view, folder
    robot.close()
    view.kill()
    server.kill()


@pytest.fixture
def robot(running):
    """The server, reset and running."""
    robot, _, _ = running
    robot.call("~/set_pause", paused=False)
    robot.call("~/reset_world")
    return robot


@pytest.fixture
def open_page(browser, running):
    """Opens pages. At the end, no page has reported an error."""
    opened = []

    def open_page(size=(1000, 700), chromium=browser, url=running[1].url, **options):
        # Playwright evaluates text, which the page's own policy forbids.
        context = chromium.new_context(viewport={"width": size[0], "height": size[1]}, bypass_csp=True, **options)
        context.set_default_timeout(1000 * TIMEOUT)
        page = context.new_page()
        errors = []
        page.on("pageerror", lambda error: errors.append(error.stack))
        page.goto(url)
        opened.append((context, errors))
        return shown(page)

    yield open_page
    for context, errors in opened:
        context.close()
        assert errors == []


@pytest.fixture
def page(robot, open_page):
    return open_page()
