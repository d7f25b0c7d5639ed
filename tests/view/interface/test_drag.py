"""Dragging with the mouse and a finger, and what the server does meanwhile."""

import math

import pytest
from view.conftest import ARGUMENTS, CHROMIUM
from view.interface import live
from view.interface.conftest import shown
from view.interface.pages import button, point, select, selected, wait
from waits import TIMEOUT, until

pytestmark = pytest.mark.slow


def lift(page, button="right", modifier="Control", height=180):
    """Presses on the box and moves the mouse upwards; it stays pressed."""
    x, y = point(page, "box")
    if modifier:
        page.keyboard.down(modifier)
    page.mouse.move(x, y)
    page.mouse.down(button=button)
    wait(page, "app.drag.active")
    for step in range(1, 7):
        page.mouse.move(x, y - step * height / 6)


def let_go(page, button="right", modifier="Control"):
    page.mouse.up(button=button)
    if modifier:
        page.keyboard.up(modifier)


def lifted(simulation):
    return simulation.box()[0][2] > 0.3


def rests(simulation):
    position, velocity = simulation.box()
    return abs(position[2] - 0.2) < 0.03 and math.hypot(*velocity) < 1e-2


def test_a_pull_lifts_the_body_on_the_server_and_after_release_it_comes_to_rest(simulation, page):
    until(lambda: rests(simulation))
    select(page, "box")
    lift(page)
    until(lambda: lifted(simulation))
    # The mouse stays still for longer than the server waits for messages.
    page.wait_for_timeout(1000)
    assert lifted(simulation)
    let_go(page)
    assert not page.evaluate("window.mjplug.app.drag.active")
    until(lambda: rests(simulation))
    assert selected(page) == "box"


@pytest.mark.parametrize("end", ["Escape", "blur"])
def test_escape_and_leaving_the_window_let_go_while_the_button_is_pressed(simulation, page, end):
    lift(page)
    until(lambda: lifted(simulation))
    if end == "Escape":
        page.keyboard.press("Escape")
    else:
        page.evaluate("window.dispatchEvent(new Event('blur'))")
    wait(page, "!app.drag.active")
    until(lambda: rests(simulation))
    # The selection stays; only the drag ends.
    assert selected(page) == "box"
    let_go(page)


def test_a_turn_turns_the_body_and_no_camera(simulation, page):
    camera = page.evaluate("window.mjplug.app.stage.camera.position.toArray()")
    x, y = point(page, "box")
    page.keyboard.down("Control")
    page.mouse.move(x, y)
    page.mouse.down()
    wait(page, "app.drag.active")
    page.mouse.move(x + 60, y)
    page.mouse.move(x + 120, y)
    page.wait_for_function("Math.abs(window.mjplug.app.stage.worlds.get(0).bodies[1].quaternion.z) > .1")
    let_go(page, "left")
    assert page.evaluate("window.mjplug.app.stage.camera.position.toArray()") == camera


def test_while_paused_a_pull_places_a_free_body(simulation, page):
    simulation.call("~/set_pause", paused=True)
    lift(page)
    page.wait_for_function("window.mjplug.app.stage.worlds.get(0).bodies[1].position.z > .35")
    let_go(page)
    assert simulation.paused
    simulation.call("~/set_pause", paused=False)
    until(lambda: rests(simulation))


def test_a_body_that_is_fixed_to_the_world_is_not_dragged_and_the_page_says_so(simulation, page):
    select(page, "post")
    page.keyboard.down("Control")
    page.mouse.down(button="right")
    page.get_by_text("post is fixed to the world and cannot be dragged.").wait_for()
    assert not page.evaluate("window.mjplug.app.drag.active")
    let_go(page)


def test_the_context_menu_of_the_browser_stays_closed(page):
    page.evaluate("addEventListener('contextmenu', (event) => (window.menu = event.defaultPrevented))")
    x, y = point(page, "box")
    page.mouse.click(x, y, button="right")
    assert page.evaluate("window.menu") is True


def test_a_browser_that_is_killed_during_a_drag_lets_go(simulation, playwright, running, tmp_path):
    context = playwright.chromium.launch_persistent_context(
        tmp_path / "profile", executable_path=CHROMIUM, args=list(ARGUMENTS),
        viewport={"width": 800, "height": 500}, bypass_csp=True,
    )  # fmt: skip
    context.set_default_timeout(1000 * TIMEOUT)
    page = context.pages[0]
    page.goto(running[1].url)
    shown(page)
    lift(page)
    until(lambda: lifted(simulation))
    assert live.kill_by_argument(str(tmp_path / "profile")) > 0
    until(lambda: rests(simulation))


def test_one_finger_pulls_in_the_drag_mode_and_a_long_press_selects(simulation, open_page):
    page = shown(open_page(size=(390, 700), has_touch=True, is_mobile=True))
    until(lambda: rests(simulation))
    session = page.context.new_cdp_session(page)

    def touch(kind, *place):
        points = [{"x": place[0], "y": place[1]}] if place else []
        session.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})

    x, y = point(page, "box")
    touch("touchStart", x, y)
    wait(page, "app.selection.current !== null")
    touch("touchEnd")
    assert selected(page) == "box"
    button(page, "Pull bodies with a drag or one finger").tap()
    touch("touchStart", x, y)
    wait(page, "app.drag.active")
    for step in range(1, 7):
        touch("touchMove", x, y - 35 * step)
    until(lambda: lifted(simulation))
    touch("touchEnd")
    wait(page, "!app.drag.active")
    until(lambda: rests(simulation))
