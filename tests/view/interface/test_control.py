"""Pause, steps, reset and speed, and what other pages see of them."""

import pytest
from playwright.sync_api import expect
from view.interface.conftest import shown
from view.interface.pages import TIMEOUT, button, state
from waits import until

pytestmark = pytest.mark.slow


def test_a_pause_on_one_page_pauses_the_server_and_is_seen_on_another(simulation, open_page):
    one, other = shown(open_page()), shown(open_page())
    state(other, "Running")
    button(one, "Pause").click()
    until(lambda: simulation.paused)
    state(other, "Paused")
    expect(button(other, "Resume")).to_be_visible(timeout=TIMEOUT)
    button(other, "Resume").click()
    until(lambda: not simulation.paused)
    state(one, "Running")
    expect(one).to_have_title("/mjplug · running · mjplug", timeout=TIMEOUT)


def test_steps_pause_first_and_are_exact(simulation, page):
    button(page, "Take 1 step").click()
    until(lambda: simulation.paused)
    state(page, "Paused")
    before = until(lambda: stands(simulation))
    button(page, "Take 10 steps").click()
    until(lambda: simulation.count("steps") == before + 10)
    button(page, "Take 100 steps").click()
    until(lambda: simulation.count("steps") == before + 110)
    assert simulation.paused


def test_reset_and_keyframe_restore_the_world(simulation, page):
    resets = simulation.count("resets")
    simulation.call("~/set_pause", paused=True)
    state(page, "Paused")
    page.get_by_label("Reset to a keyframe").select_option("lifted")
    until(lambda: simulation.count("resets") == resets + 1)
    expect(page.locator(".status .resets")).to_have_text(f"{resets + 1} resets", timeout=TIMEOUT)
    expect(page.get_by_label("Reset to a keyframe")).to_have_value("")
    page.wait_for_function("Math.abs(window.mjplug.app.stage.worlds.get(0).bodies[1].position.z - 1) < 1e-3")
    button(page, "Reset the world to its initial state").click()
    page.wait_for_function("Math.abs(window.mjplug.app.stage.worlds.get(0).bodies[1].position.z - .2) < 1e-3")


def test_the_speed_is_set_and_follows_the_server(simulation, open_page):
    one, other = shown(open_page()), shown(open_page())
    speeds = [page.get_by_label("Speed relative to real time") for page in (one, other)]
    speeds[0].select_option("0.5")
    until(lambda: simulation.parameter("sim.speed") == 0.5)
    expect(speeds[1]).to_have_value("0.5", timeout=TIMEOUT)
    speeds[0].select_option("max")
    until(lambda: simulation.parameter("sim.speed") == "max")
    speeds[0].select_option("Other …")
    one.get_by_role("dialog").get_by_role("spinbutton").fill("0.3")
    one.get_by_role("dialog").get_by_role("button", name="Set speed").click()
    until(lambda: simulation.parameter("sim.speed") == 0.3)
    expect(speeds[1]).to_have_value("0.3", timeout=TIMEOUT)
    expect(speeds[1].locator("option:checked")).to_have_text("0.30\N{MULTIPLICATION SIGN}")


def test_a_refusal_is_shown_in_the_words_of_the_server(page):
    keyframes = page.get_by_label("Reset to a keyframe")
    keyframes.evaluate("list => list.append(new Option('gone', 'gone'))")
    keyframes.select_option("gone")
    notice = page.locator(".notice.error")
    expect(notice).to_contain_text("gone", timeout=TIMEOUT)
    expect(notice).to_contain_text("lifted")


def test_a_page_that_is_opened_while_paused_shows_the_state(simulation, open_page):
    simulation.call("~/reset_world", keyframe="lifted")
    simulation.call("~/set_pause", paused=True)
    page = shown(open_page())
    state(page, "Paused")
    height = page.evaluate("window.mjplug.app.stage.worlds.get(0).bodies[1].position.z")
    assert 0.15 < height <= 1.0
    assert page.evaluate("window.mjplug.stats().drawn") > 0


def stands(simulation):
    """Returns the number of steps as soon as two reports agree."""
    first = simulation.count("steps")
    simulation.call("~/step_simulation", steps=1)
    return until(lambda: (count := simulation.count("steps")) > first and count)
