"""What tests read from a page and do on it."""

import waits
from playwright.sync_api import expect

TIMEOUT = 1000 * waits.TIMEOUT


def state(page, text):
    """Waits until the status line says that the simulation runs, or is paused."""
    expect(page.locator(".status .state")).to_have_text(text, timeout=TIMEOUT)


def button(page, name):
    return page.get_by_role("button", name=name, exact=True)


def wait(page, condition, arg=None):
    page.wait_for_function(f"arg => {{ const app = window.mjplug.app; return {condition}; }}", arg=arg)


def point(page, body):
    """Returns the place of a body on the page [px]."""
    found = page.evaluate("body => window.mjplug.point(body)", body)
    return found["x"], found["y"]


def selected(page):
    """Returns the name of the selected body; None if there is none."""
    return page.evaluate(
        """() => {
            const selected = window.mjplug.app.selection.current;
            return selected === null ? null : selected.world.pack.header.bodies[selected.body].name;
        }"""
    )


def select(page, body):
    """Double-clicks a body."""
    page.mouse.dblclick(*point(page, body))
    wait(page, "app.selection.current?.world.bodies[app.selection.current.body].name === arg", body)
