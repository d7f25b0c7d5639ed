"""Joints, pushes, placing and driving from the page."""

import contextlib
import math
import uuid

import numpy as np
import pytest
from playwright.sync_api import expect
from view.conftest import ARGUMENTS, CHROMIUM
from view.interface.live import View, kill_by_argument
from view.topics.robot import open_panel
from waits import TIMEOUT, until

from mjplug_schemas.geometry_msgs import Twist

pytestmark = [pytest.mark.slow, pytest.mark.timeout(300)]


def switch_on(page):
    panel = open_panel(page, "Drive")
    panel.get_by_label("Drive", exact=True).select_option("/cmd_vel")
    panel.get_by_role("button", name="Switch on", exact=True).click()
    expect(page.locator(".drive-banner")).to_be_visible()


def rests(robot):
    return np.abs(robot.body("base_link")[2][:2]).max() < 0.01


def drives(robot):
    return np.hypot(*robot.body("base_link")[2][:2]) > 0.3


@pytest.fixture
def commands(robot):
    """The commands that the base gets, as they arrive."""
    received = []
    with robot.client.subscribe("/cmd_vel", Twist, received.append):
        yield received


def test_a_slider_moves_its_joint_and_shows_the_measured_position(robot, page):
    panel = open_panel(page, "Joints")
    field = panel.get_by_label("shoulder [rad]")
    field.fill("0.5")
    field.press("Enter")
    until(lambda: abs(robot.joint("shoulder") - 0.5) < 0.05)
    expect(panel.locator(".joint", has_text="shoulder").locator(".measured")).to_contain_text("rad")
    # The limits are those of the model.
    slider = panel.get_by_label("shoulder", exact=True)
    assert float(slider.get_attribute("min")) == pytest.approx(-math.pi / 2)
    assert float(slider.get_attribute("max")) == pytest.approx(math.pi / 3)
    panel.get_by_label("Degrees").check()
    field = panel.get_by_label("shoulder [°]")
    field.fill("-30")
    field.press("Enter")
    until(lambda: abs(robot.joint("shoulder") + math.pi / 6) < 0.05)
    field.fill("500")
    field.press("Enter")
    until(lambda: abs(robot.joint("shoulder") - math.pi / 3) < 0.05)
    panel.get_by_label("Degrees").uncheck()


def test_a_joint_moves_while_its_button_is_held(robot, page):
    panel = open_panel(page, "Joints")
    plus = panel.get_by_role("button", name="Jog shoulder up")
    expect(panel.locator(".joint", has_text="shoulder").locator(".measured")).to_contain_text("rad")
    before = robot.joint("shoulder")
    plus.hover()
    page.mouse.down()
    until(lambda: robot.joint("shoulder") > before + 0.2)
    page.mouse.up()
    until(lambda: abs(robot.joint("shoulder") - robot.joint("shoulder")) < 1e-3)
    stopped = robot.joint("shoulder")
    page.wait_for_timeout(500)
    assert abs(robot.joint("shoulder") - stopped) < 0.02


def test_keys_jog_a_joint_while_switched_on(robot, page):
    panel = open_panel(page, "Drive")
    panel.get_by_label("Drive", exact=True).select_option(label="a joint: /arm/joint_commands")
    panel.get_by_label("Joint", exact=True).select_option("shoulder")
    panel.get_by_role("button", name="Switch on", exact=True).click()
    until(lambda: robot.subscribed("joint_states"))
    before = robot.joint("shoulder")
    page.keyboard.down("ArrowDown")
    until(lambda: robot.joint("shoulder") < before - 0.2)
    page.keyboard.up("ArrowDown")
    stopped = until(lambda: robot.joint("shoulder"))
    page.wait_for_timeout(500)
    assert abs(robot.joint("shoulder") - stopped) < 0.05
    page.keyboard.press("Escape")
    until(lambda: not robot.subscribed("joint_states"))


def test_buttons_that_jog_joints_leave_nothing_behind_when_they_are_replaced(robot, page):
    panel = open_panel(page, "Joints")
    expect(panel.get_by_role("button", name="Jog shoulder up")).to_be_visible()
    session = page.context.new_cdp_session(page)

    def listeners():
        session.send("HeapProfiler.collectGarbage")
        return session.send("Memory.getDOMCounters")["jsEventListeners"]

    before = listeners()
    for _ in range(10):
        panel.get_by_label("Degrees").check()
        panel.get_by_label("Degrees").uncheck()
    # Each pair of changes would leave the listeners of all buttons twice.
    assert listeners() < before + 20


def test_nothing_is_repeated_unless_hold_is_on(robot, page):
    received = []
    panel = open_panel(page, "Joints")
    field = panel.get_by_label("reach [m]")
    with robot.client.subscribe("/arm/joint_commands", "sensor_msgs/msg/JointState", received.append):
        field.fill("0.1")
        field.press("Enter")
        until(lambda: received)
        page.wait_for_timeout(500)
        assert len(received) == 1
        panel.get_by_label("Hold").check()
        field.fill("0.15")
        field.press("Enter")
        until(lambda: len(received) > 5)
    assert {tuple(message.name) for message in received} == {("reach",)}
    assert received[-1].position[0] == 0.15


def test_a_push_moves_the_body(robot, page):
    panel = open_panel(page, "Push")
    panel.get_by_label("Body").select_option("box")
    for name, value in (("Force x [N]", "0"), ("Force y [N]", "-120"), ("Duration", "0.4")):
        panel.get_by_label(name).fill(value)
    before = robot.body("box")[0]
    panel.get_by_role("button", name="Push").click()
    until(lambda: robot.body("box")[0][1] < before[1] - 0.1)
    expect(panel.get_by_text("applied")).to_be_visible(timeout=1000 * TIMEOUT)
    assert abs(robot.body("box")[0][0] - before[0]) < 0.05


def test_a_body_is_placed_and_the_form_starts_with_its_present_pose(robot, page):
    panel = open_panel(page, "Place")
    panel.get_by_label("Body").select_option("box")
    panel.get_by_role("button", name="From the present pose").click()
    assert float(panel.get_by_label("Position x [m]").input_value()) == pytest.approx(1.0, abs=0.02)
    for name, value in (("Position x [m]", "-2"), ("Position y [m]", "-1.5"), ("Orientation yaw [°]", "90")):
        panel.get_by_label(name).fill(value)
    panel.get_by_role("button", name="Place", exact=True).click()
    until(lambda: np.allclose(robot.body("box")[0][:2], (-2.0, -1.5), atol=0.02))
    _, turn, _ = robot.body("box")
    assert np.allclose(np.abs(turn), (0, 0, math.sqrt(0.5), math.sqrt(0.5)), atol=0.02)
    assert turn[2] * turn[3] > 0


def test_keys_drive_only_while_switched_on_and_release_stops_the_base(robot, page, commands):
    open_panel(page, "Drive")
    page.keyboard.down("i")
    page.wait_for_timeout(300)
    page.keyboard.up("i")
    switch_on(page)
    page.keyboard.press("Tab")
    open_panel(page, "Topics")
    page.get_by_label("Search topics").fill("i j k l , . u o m")
    assert commands == []
    page.locator(".drive-banner span").first.click()
    page.get_by_label("Search topics").blur()
    page.keyboard.down("i")
    # The base is still accelerating when it begins to move.
    until(lambda: robot.body("base_link")[2][0] == pytest.approx(0.5, abs=0.05))
    page.keyboard.up("i")
    until(lambda: rests(robot))
    assert commands[-1] == Twist()
    sent = len(commands)
    page.keyboard.press("Escape")
    expect(page.locator(".drive-banner")).to_be_hidden()
    page.keyboard.press("i")
    page.wait_for_timeout(300)
    assert len(commands) <= sent + 1


BLUR = "window.dispatchEvent(new Event('blur'))"
HIDE = """
    Object.defineProperty(document, "hidden", { value: true });
    document.dispatchEvent(new Event("visibilitychange"));
"""


@pytest.mark.parametrize("loss", [BLUR, HIDE], ids=["blur", "hidden"])
def test_the_base_stops_when_the_page_loses_the_focus_or_is_hidden(robot, page, commands, loss):
    switch_on(page)
    page.keyboard.down("ArrowUp")
    until(lambda: drives(robot))
    # The key is still down.
    page.evaluate(loss)
    until(lambda: commands[-1] == Twist())
    until(lambda: rests(robot))
    page.wait_for_timeout(300)
    assert commands[-1] == Twist()


def test_the_base_stops_when_the_browser_is_killed(robot, playwright, open_page, commands):
    mark = f"--mark={uuid.uuid4()}"
    chromium = playwright.chromium.launch(executable_path=CHROMIUM, args=[*ARGUMENTS, mark])
    page = open_page(chromium=chromium)
    switch_on(page)
    page.keyboard.down("w")
    until(lambda: drives(robot))
    assert kill_by_argument(mark)
    # The relay publishes zero; the base does not have to wait for its own timeout.
    until(lambda: commands[-1] == Twist())
    until(lambda: rests(robot))
    with contextlib.suppress(Exception):
        chromium.close()


def test_a_finger_on_the_joystick_drives_and_lets_go(robot, page, commands):
    panel = open_panel(page, "Drive")
    panel.get_by_label("Joystick on the screen").check()
    switch_on(page)
    stick = page.locator(".joystick").bounding_box()
    x, y = stick["x"] + stick["width"] / 2, stick["y"] + stick["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x, y - 0.4 * stick["height"])
    until(lambda: drives(robot))
    page.mouse.up()
    until(lambda: commands[-1] == Twist())
    until(lambda: rests(robot))


def test_a_read_only_page_drives_nothing(running, robot, open_page):
    _, _, folder = running
    view = View(robot.endpoint, "--read-only", cwd=folder)
    try:
        page = open_page(url=view.url)
        panel = open_panel(page, "Drive")
        button = panel.get_by_role("button", name="Switch on", exact=True)
        until(lambda: button.get_attribute("aria-disabled") == "true")
        button.click(force=True)
        expect(page.locator(".drive-banner")).to_be_hidden()
        expect(open_panel(page, "Joints").get_by_label("shoulder [rad]")).to_be_disabled()
    finally:
        view.kill()
