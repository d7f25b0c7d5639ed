"""Selection, keyboard, narrow screens, lost servers, and pages that only look."""

import re

import pytest
from playwright.sync_api import expect
from view.interface import live
from view.interface.conftest import shown
from view.interface.pages import TIMEOUT, button, select, selected, state, wait
from waits import until

pytestmark = pytest.mark.slow


def test_a_double_click_selects_and_the_panel_describes_the_body(simulation, page):
    button(page, "Show the model panels").click()
    select(page, "box")
    panel = page.locator("details", has=page.get_by_text("Selection", exact=True))
    for text in ("4.00 kg", "free", "crate", "box, group 0"):
        expect(panel).to_contain_text(text)
    expect(panel).to_contain_text(re.compile(r"z0\.\d{4} m"), timeout=TIMEOUT)
    page.keyboard.press("Escape")
    assert selected(page) is None
    page.mouse.dblclick(400, 60)
    assert selected(page) is None


def test_the_pose_is_shown_in_the_chosen_frame(simulation, page):
    simulation.call("~/set_pause", paused=True)
    button(page, "Show the model panels").click()
    page.evaluate(
        """() => {
            const { selection, stage } = window.mjplug.app;
            selection.select({ world: stage.worlds.get(0), body: 4 });
        }"""
    )
    values = page.locator("dl.properties", has=page.get_by_text("roll", exact=True))
    expect(values).to_contain_text("x\N{MINUS SIGN}1.0000 m")
    page.get_by_label("Pose in").select_option("parent")
    expect(values).to_contain_text("x0.0000 m")
    expect(values).to_contain_text("z\N{MINUS SIGN}0.4500 m")


def test_everything_is_reached_and_done_with_the_keyboard(simulation, page):
    names = set()
    for _ in range(60):
        page.keyboard.press("Tab")
        names.add(
            page.evaluate("document.activeElement.getAttribute('aria-label') ?? document.activeElement.textContent")
        )
    assert {"Pause", "Take 1 step", "Reset the world to its initial state", "Help", "View", "Overlays"} <= names
    page.evaluate("document.activeElement.blur()")
    page.keyboard.press("Space")
    until(lambda: simulation.paused)
    page.keyboard.press("/")
    page.keyboard.type("hand")
    page.keyboard.press("Enter")
    assert selected(page) == "hand"
    page.keyboard.press("ArrowDown")
    page.keyboard.press("Home")
    page.keyboard.press("ArrowDown")
    page.keyboard.press("Enter")
    # The tree still shows what the search found: the hand and what it is part of.
    assert selected(page) == "arm"
    page.keyboard.press("Escape")
    assert selected(page) is None


def test_letters_do_nothing_in_a_field_and_can_be_switched_off(simulation, page):
    page.keyboard.press("/")
    page.keyboard.type("s d?")
    assert page.evaluate("window.mjplug.app.drag.mode") == "off"
    page.evaluate("document.activeElement.blur()")
    page.keyboard.press("d")
    assert page.evaluate("window.mjplug.app.drag.mode") == "pull"
    page.keyboard.press("d")
    page.keyboard.press("?")
    help_ = page.get_by_role("dialog", name="Shortcuts and gestures")
    expect(help_).to_contain_text("Pause or resume")
    expect(help_).to_contain_text("Ctrl + right drag")
    help_.get_by_label("Shortcuts with single keys").uncheck()
    page.keyboard.press("Escape")
    expect(help_).to_have_count(0)
    page.keyboard.press("d")
    assert page.evaluate("window.mjplug.app.drag.mode") == "off"
    page.keyboard.press("?")
    help_.get_by_label("Shortcuts with single keys").check()


def test_overlays_are_requested_only_while_they_are_on(page):
    sent = page.evaluate(
        """() => {
            window.sent = [];
            const { source } = window.mjplug.app;
            const overlay = source.overlay.bind(source);
            source.overlay = (server, kind, on) => { window.sent.push([kind, on]); overlay(server, kind, on); };
            return window.sent;
        }"""
    )
    assert sent == []
    page.get_by_label("Contacts", exact=True).check()
    wait(page, "(app.stage.worlds.get(0).overlays.get('contacts')?.count ?? 0) > 0")
    page.get_by_label("Contacts", exact=True).uncheck()
    assert page.evaluate("window.sent") == [["contacts", True], ["contacts", False]]
    wait(page, "!app.stage.worlds.get(0).overlays.has('contacts')")


@pytest.mark.parametrize("width", [360, 390, 1024])
def test_the_page_fits_into_narrow_windows(page, width):
    page.set_viewport_size({"width": width, "height": 740})
    if width < 720:
        button(page, "Show the panels").click()
    outside = page.evaluate(
        """() => [...document.querySelectorAll("button, select, input, .cell, summary")]
            .filter((part) => part.checkVisibility())
            .filter((part) => {
                const { left, right } = part.getBoundingClientRect();
                return left < -0.5 || right > innerWidth + 0.5;
            })
            .map((part) => part.outerHTML.slice(0, 80))"""
    )
    assert outside == []
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")


def test_the_theme_follows_the_system_until_one_is_chosen(page):
    theme = "document.documentElement.dataset.theme"
    assert page.evaluate(theme) == "dark"
    page.emulate_media(color_scheme="light")
    wait(page, "document.documentElement.dataset.theme === 'light'")
    page.locator("button[aria-label^='Colours of the system']").click()
    assert page.evaluate(theme) == "dark"
    page.reload()
    shown(page)
    assert page.evaluate(theme) == "dark"


def test_a_page_that_only_looks_has_no_controls_and_says_why(simulation, open_page, running, folder):
    view = live.View(running[0].endpoint, "--read-only", cwd=folder)
    try:
        page = shown(open_page(view.url))
        pause = button(page, "Pause")
        expect(pause).to_have_attribute("aria-disabled", "true", timeout=TIMEOUT)
        expect(pause).to_have_attribute("title", "Pause: mjplug view was started with --read-only.")
        pause.click(force=True)
        expect(page.get_by_text("mjplug view was started with --read-only.").first).to_be_visible()
        expect(page.get_by_label("Speed relative to real time")).to_be_disabled()
        select(page, "box")
        page.keyboard.down("Control")
        page.mouse.down(button="right")
        expect(page.get_by_text("Bodies cannot be dragged")).to_be_visible()
        assert not page.evaluate("window.mjplug.app.drag.active")
        page.mouse.up(button="right")
        page.keyboard.up("Control")
        assert not simulation.paused
    finally:
        view.kill()


def test_a_server_that_ends_is_missed_and_its_successor_with_another_model_is_shown(folder, open_page):
    server = live.Served("toys.xml", cwd=folder)
    listen = ("--listen", server.endpoint)
    view = live.View(server.endpoint, cwd=folder)
    try:
        page = shown(open_page(view.url))
        wait(page, "app.stage.worlds.get(0).pack.header.name === 'toys'")
        server.kill()
        expect(page.locator(".status .connection")).to_have_text("/mjplug is gone; waiting for it", timeout=TIMEOUT)
        expect(page.locator(".banner")).to_be_visible()
        expect(page).to_have_title("/mjplug · gone · mjplug", timeout=TIMEOUT)
        expect(button(page, "Pause")).to_have_attribute("aria-disabled", "true")
        server = live.Served("other.xml", cwd=folder, listen=listen)
        wait(page, "app.stage.worlds.get(0).pack.header.name === 'other'")
        expect(page.locator(".banner")).to_be_hidden()
        state(page, "Running")
        expect(page.locator(".tree .line", has_text="ball")).to_have_count(1)
    finally:
        view.kill()
        server.kill()


def test_a_relay_that_ends_is_reported_and_found_again(folder, running, open_page):
    simulation = running[0]
    view = live.View(simulation.endpoint, cwd=folder)
    port = view.url.rstrip("/").rpartition(":")[2]
    try:
        page = shown(open_page(view.url))
        view.kill()
        expect(page.locator(".status .connection")).to_contain_text("mjplug view does not answer", timeout=TIMEOUT)
        expect(page).to_have_title("not connected · mjplug")
        view = live.View(simulation.endpoint, "--port", port, cwd=folder)
        expect(page.locator(".status .connection")).to_have_text("/mjplug", timeout=TIMEOUT)
        frames = page.evaluate("window.mjplug.stats().frames")
        page.wait_for_function("frames => window.mjplug.stats().frames > frames", arg=frames)
    finally:
        view.kill()
