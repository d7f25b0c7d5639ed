"""Topics in the scene, and pictures of cameras."""

import json

import numpy as np
import pytest
from playwright.sync_api import expect
from view.topics.robot import drawn, open_panel, points, show, status
from waits import TIMEOUT, until

from mjplug_schemas.geometry_msgs import Twist, Vector3

pytestmark = [pytest.mark.slow, pytest.mark.timeout(300)]

LIMITS = np.array([3.0, 2.0])
"""Distances of the inner faces of the walls from the middle of the room [m]."""


def off_the_walls(found):
    """Returns the distance of each point from the nearest wall, shape (n,)."""
    return np.abs(np.abs(found[:, :2]) - LIMITS).min(axis=1)


def on_other_bodies(robot, found):
    """Whether each point is on the box or on the arm, shape (n,)."""
    box, base = robot.body("box")[0][:2], robot.body("base_link")[0][:2]
    return (np.abs(found[:, :2] - box).max(axis=1) < 0.22) | (np.linalg.norm(found[:, :2] - base, axis=1) < 0.6)


def check_scan(robot, found, tolerance):
    wrong = found[(off_the_walls(found) > tolerance) & ~on_other_bodies(robot, found)]
    assert wrong.size == 0, wrong
    assert (off_the_walls(found) <= tolerance).sum() > 120


def test_points_of_a_scan_lie_on_the_walls(robot, page):
    show(page, "/scan")
    found = drawn(page, "/scan")
    check_scan(robot, found, 0.002)
    # The base has settled on the floor: half its height, and the height of the lidar above it.
    assert abs(found[:, 2] - 0.3).max() < 0.01
    until(lambda: "180 points" in status(page, "/scan"))


def test_a_scan_stays_on_the_walls_while_the_robot_turns_and_moves(robot, page):
    show(page, "/scan")
    publisher = robot.client.publisher("/cmd_vel", Twist)
    turning = Twist(linear=Vector3(x=0.2), angular=Vector3(z=1.5))
    checked = []
    drawn(page, "/scan")

    def turned():
        publisher.publish(turning)
        if abs(robot.body("base_link")[1][2]) > 0.2:
            found = points(page, "/scan")
            publisher.publish(turning)
            # The base may move away from where the scan saw the arm.
            check_scan(robot, found, 0.05)
            checked.append(found)
        return len(checked) >= 3

    until(turned)


def test_points_of_a_cloud_lie_on_the_surfaces(robot, page):
    show(page, "/points")
    found = drawn(page, "/points")
    on_floor = np.abs(found[:, 2]) < 0.01
    ok = (off_the_walls(found) < 0.005) | on_floor | on_other_bodies(robot, found)
    assert ok.all(), found[~ok]
    assert (off_the_walls(found) < 0.005).sum() > 200
    assert on_floor.sum() > 50


def test_a_topic_is_subscribed_to_only_while_it_is_shown(robot, page):
    open_panel(page, "Topics")
    page.get_by_label("/scan", exact=True).wait_for()
    for key in ("scan", "tf", "tf_static"):
        assert not robot.subscribed(key)
    show(page, "/scan")
    drawn(page, "/scan")
    for key in ("scan", "tf", "tf_static"):
        until(lambda key=key: robot.subscribed(key))
    show(page, "/scan", False)
    for key in ("scan", "tf", "tf_static"):
        until(lambda key=key: not robot.subscribed(key))
    assert points(page, "/scan").size == 0


def test_a_frame_without_a_transform_is_reported_in_words(robot, page):
    show(page, "/lost")
    until(lambda: status(page, "/lost") == "No transform from lost to world.")
    # The message of the other odometry contains the transform of its frame.
    show(page, "/odom")
    until(lambda: "points" in status(page, "/odom"))


ARROW = """() => {
    const group = window.mjplug.app.stage.scene.getObjectByName("topic /push/wrench_markers");
    const arrows = [];
    group?.children.forEach((shape) => {
        if (!shape.visible) return;
        shape.updateWorldMatrix(true, true);
        let tip = null;
        shape.traverse((object) => { if (object.isMesh) tip = object.getWorldPosition(object.position.clone()); });
        arrows.push([shape.getWorldPosition(shape.position.clone()).toArray(), tip.toArray()]);
    });
    return arrows;
}"""


def test_the_arrow_of_a_push_is_at_its_body_points_along_the_force_and_disappears(robot, page):
    show(page, "/push/wrench_markers")
    until(lambda: robot.subscribed("push/wrench_markers"))
    push = {"wrench": {"header": {"frame_id": "box"}, "wrench": {"force": {"y": 1.0}}}, "duration": {"sec": 3}}
    session = robot.client.session
    replies = session.get(
        "push/apply_wrench",
        payload=json.dumps({"wrenches": {"external_wrenches": [push]}}),
        encoding="application/json",
    )
    ((origin, tip),) = until(lambda: page.evaluate(ARROW))
    box = robot.body("box")[0]
    assert np.allclose(origin, box, atol=0.05)
    assert tip[1] > origin[1]
    assert abs(tip[0] - origin[0]) < 1e-3
    assert next(iter(replies)).ok is not None
    until(lambda: not page.evaluate(ARROW))


COLOURS = """() => {
    const image = document.querySelector(".picture-image");
    const canvas = document.createElement("canvas");
    [canvas.width, canvas.height] = [image.naturalWidth, image.naturalHeight];
    const drawing = canvas.getContext("2d");
    drawing.drawImage(image, 0, 0);
    const at = (x, y) => [...drawing.getImageData(x, y, 1, 1).data.slice(0, 3)];
    return { size: [canvas.width, canvas.height], wall: at(160, 105), floor: at(160, 200) };
}"""


@pytest.mark.parametrize("size", [(1000, 700), (390, 844)], ids=["desktop", "phone"])
def test_a_camera_shows_its_picture_with_time_and_rate(robot, open_page, size):
    page = open_page(size)
    if size[0] < 700:
        page.get_by_role("button", name="Show the panels").click()
    show(page, "/front/image")
    image = page.locator(".picture-image")
    expect(image).to_be_visible(timeout=1000 * TIMEOUT)
    until(lambda: page.evaluate("document.querySelector('.picture-image').naturalWidth") > 0)
    found = page.evaluate(COLOURS)
    assert found["size"] == [320, 240]
    # The east wall is reddish, the floor is grey.
    red, green, blue = found["wall"]
    assert red > green + 15 > blue
    assert max(found["floor"]) - min(found["floor"]) < 30
    expect(page.locator(".picture-caption")).to_contain_text(" Hz")
    assert page.locator(".picture-strip").is_visible() == (size[0] < 700)
    assert page.locator(".window").count() == (0 if size[0] < 700 else 1)
    if size[0] > 700:
        page.get_by_role("button", name="Close /front/image").click()
    else:
        show(page, "/front/image", False)
    expect(image).to_have_count(0)
    expect(page.get_by_label("/front/image", exact=True)).not_to_be_checked()
    until(lambda: not robot.subscribed("front/image"))


def test_what_is_shown_is_shown_again_after_a_reload(robot, page):
    show(page, "/scan")
    drawn(page, "/scan")
    page.reload()
    drawn(page, "/scan")
