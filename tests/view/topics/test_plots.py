"""Plots of fields against simulated time."""

import csv
import io

import pytest
from playwright.sync_api import expect
from view.topics.robot import open_panel
from waits import TIMEOUT, until

pytestmark = [pytest.mark.slow, pytest.mark.timeout(300)]


def add_plot(page, topic, *paths):
    panel = open_panel(page, "Plots")
    panel.get_by_role("button", name="Add a plot").click()
    page.locator(".browser .choice", has_text=topic).first.click()
    for path in paths:
        page.locator(".browser .choice", has_text=path).first.click()
    page.keyboard.press("Escape")


def saved(page):
    """Returns the rows of the CSV file that the page saves."""
    with page.expect_download() as download:
        page.get_by_role("button", name="Save as CSV").click()
    with open(download.value.path(), newline="") as file:
        return list(csv.reader(io.StringIO(file.read())))


def test_a_plot_and_its_csv_contain_every_sample_of_the_server(robot, page):
    seen = {}

    def remember(state):
        stamp = state.header.stamp
        seen[round(stamp.sec + 1e-9 * stamp.nanosec, 9)] = dict(zip(state.name, state.position, strict=True))

    with robot.client.subscribe("/joint_states", callback=remember):
        add_plot(page, "/joint_states", "position[shoulder]", "position[reach]")
        robot.client.publish("/arm/joint_commands", {"name": ["shoulder", "reach"], "position": [0.4, 0.1]})
        rows = until(lambda: len(got := saved(page)) > 60 and got)
        until(lambda: max(seen) > float(rows[-1][0]))
    assert rows[0] == ["time [s]", "/joint_states position[shoulder]", "/joint_states position[reach]"]
    times = [float(row[0]) for row in rows[1:]]
    assert times == sorted(set(times))
    for time, *values in rows[1:]:
        for joint, value in zip(("shoulder", "reach"), values, strict=True):
            # The second field was added a moment after the first.
            assert value == "" or float(value) == seen[float(time)][joint]
    assert "" not in rows[-1]
    # None is missing in between.
    between = [time for time in seen if times[0] <= time <= times[-1]]
    assert len(between) == len(times)


def test_a_plot_shows_units_survives_a_reload_and_ends_its_subscription(robot, page):
    add_plot(page, "/odom", "pose.pose.position.x")
    legend = page.locator(".plot-chart .u-legend")
    expect(legend).to_contain_text("pose.pose.position.x", timeout=1000 * TIMEOUT)
    until(lambda: robot.subscribed("odom"))
    page.reload()
    expect(legend).to_contain_text("pose.pose.position.x", timeout=1000 * TIMEOUT)
    until(lambda: len(saved(page)) > 10)
    canvas = page.locator(".plot-chart .u-over").bounding_box()
    page.mouse.move(canvas["x"] + 0.8 * canvas["width"], canvas["y"] + 0.5 * canvas["height"])
    expect(legend).to_contain_text(" m", timeout=1000 * TIMEOUT)
    page.get_by_role("button", name="Close /odom pose.pose.position.x").click()
    until(lambda: not robot.subscribed("odom"))
    page.reload()
    page.wait_for_function("window.mjplug?.app.servers.frame != null")
    assert page.locator(".plot-chart").count() == 0
