"""The scene of the page: camera, picking, several servers, changes of the model, and missing graphics."""

import cv2
import mujoco
import numpy as np
import pytest
from view.native import difference
from view.scenes import ALL_FEATURES
from view.studio import PAUSED, Server

BOXES = """
<mujoco model="boxes">
  <statistic center="0 0 .5" extent="2"/>
  <visual><headlight ambient=".5 .5 .5" diffuse=".5 .5 .5" specular="0 0 0"/></visual>
  <worldbody>
    <geom name="floor" type="plane" size="2 2 .1" rgba=".2 .2 .2 1"/>
    <body name="red" pos="-.5 0 .5"><freejoint/><geom name="red_box" type="box" size=".1 .1 .1" rgba="1 0 0 1"/></body>
    <body name="green" pos=".5 0 .5"><freejoint/><geom name="green_box" type="box" size=".1 .1 .1" rgba="0 1 0 1"/>
      <site name="button" pos="0 0 .1" size=".03" rgba="0 0 1 1"/></body>
    <body name="empty" pos="0 0 1"/>
  </worldbody>
</mujoco>
"""


def boxes():
    return mujoco.MjModel.from_xml_string(BOXES)


def color_at(page, place):
    box = page.page.evaluate("window.mjplug.app.stage.canvas.getBoundingClientRect().toJSON()")
    return page.picture()[round(place["y"] - box["y"]), round(place["x"] - box["x"])].tolist()


def point(page, body, server=None):
    return page.page.evaluate("([body, server]) => window.mjplug.point(body, server ?? undefined)", [body, server])


def test_bodies_are_drawn_where_the_page_projects_them(studio):
    page = studio(boxes())
    page.show()
    red, green = color_at(page, point(page, "red")), color_at(page, point(page, "green"))
    assert red[0] > 120
    assert max(red[1:]) < 10
    assert green[1] > 120
    assert max(green[0], green[2]) < 10
    assert point(page, "nobody") is None


def test_the_nearest_visible_object_is_picked(studio):
    page = studio(boxes())
    page.show()

    def pick(place):
        return page.page.evaluate(
            """({x, y}) => {
                const picked = window.mjplug.app.stage.pick(x, y);
                return picked && [picked.body, picked.name, picked.point.toArray(), picked.world.server];
            }""",
            place,
        )

    body, name, where, server = pick(point(page, "red"))
    assert (body, name, server) == (1, "red_box", 0)
    assert np.max(np.abs(np.subtract(where, (-0.5, 0, 0.5)))) < 0.101
    above = page.evaluate("stage.project(world, 2, [0, 0, 0.12])")
    assert pick(above)[:2] == [2, "button"]
    page.redraw("world.setGroup('site', 0, false)")
    assert pick(above)[1] != "button"
    page.redraw("world.setGroup('geom', 0, false)")
    assert pick(point(page, "red")) is None


def test_fit_brings_all_moving_bodies_into_the_picture(studio):
    server = Server(boxes())
    server.data.qpos[:3] = 30, 5, 2
    mujoco.mj_forward(server.model, server.data)
    page = studio(server)
    page.show()
    page.redraw("stage.fit()")
    box = page.page.evaluate("window.mjplug.app.stage.canvas.getBoundingClientRect().toJSON()")
    for body in ("red", "green"):
        place = point(page, body)
        assert box["left"] < place["x"] < box["right"]
        assert box["top"] < place["y"] < box["bottom"]
    page.redraw("stage.fit([1])")
    assert color_at(page, point(page, "red"))[0] > 120


def test_the_camera_follows_a_body(studio):
    server = Server(boxes())
    page = studio(server)
    page.show()
    page.redraw("stage.follow(world, 1)")
    before = point(page, "red")
    server.data.qpos[:3] = 3, 4, 5
    mujoco.mj_forward(server.model, server.data)
    page.show()
    assert point(page, "red") == pytest.approx(before, abs=0.1)
    page.redraw("stage.follow(world, null)")
    server.data.qpos[:3] = -0.5, 0, 0.5
    mujoco.mj_forward(server.model, server.data)
    page.show()
    assert point(page, "red") != pytest.approx(before, abs=5)


def test_the_selected_body_is_outlined(studio):
    page = studio(boxes())
    page.show()
    plain = page.picture()
    page.redraw("world.outline(1)")
    outlined = page.picture()
    changed = np.abs(outlined.astype(int) - plain).max(axis=2) > 60
    assert 50 < changed.sum() < 0.05 * changed.size
    place = color_at(page, point(page, "red"))
    assert place[0] > 120
    page.redraw("world.outline(null)")
    assert difference(page.picture(), plain) == 0


def test_an_outline_leaves_no_line_where_the_body_was_before(studio):
    server = Server(boxes())
    # On its edge, so that the corners of the part of the picture that contains the box are far from the box.
    server.data.qpos[3:7] = np.cos(np.pi / 8), 0, np.sin(np.pi / 8), 0
    mujoco.mj_forward(server.model, server.data)
    page = studio(server)
    page.show()
    page.redraw("world.outline(1)")
    server.data.qpos[0] += 0.2
    mujoco.mj_forward(server.model, server.data)
    page.show()
    outlined = page.picture().astype(int)
    page.redraw("world.outline(null)")
    plain = page.picture().astype(int)
    box = (plain[:, :, 0] > 60) & (plain[:, :, 1] < 10)
    around = cv2.dilate(box.astype(np.uint8), np.ones((15, 15))) > 0
    changed = np.abs(outlined - plain).max(axis=2) > 20
    assert (changed & around).sum() > 50
    assert not (changed & ~around).any()


def test_nothing_is_drawn_while_nothing_changes(studio):
    page = studio(boxes())
    page.show(flags=PAUSED)
    frames = """count => new Promise((done) => {
        const next = () => (count-- > 0 ? requestAnimationFrame(next) : done());
        next();
    })"""
    page.page.evaluate(frames, 20)
    drawn = page.stats()["drawn"]
    page.page.evaluate(frames, 20)
    assert page.stats()["drawn"] == drawn
    assert page.stats()["median_age"] >= 0


def test_every_item_is_acknowledged_after_it_is_drawn(studio):
    page = studio(boxes())
    for _ in range(3):
        page.show()
        page.page.wait_for_timeout(0)
        page.page.evaluate("() => new Promise(requestAnimationFrame)")
    assert page.acknowledged == 3
    assert page.stats()["frames"] == 3
    assert page.stats()["applied"] == 3


def test_a_new_model_replaces_the_old_one_and_frees_its_memory(studio):
    first, second = boxes(), mujoco.MjModel.from_xml_string(ALL_FEATURES)
    server = Server(first)
    page = studio(server)

    def load(model):
        server.load(model)
        page.send({"op": "info", "server": 0, "info": server.info()})
        page.page.wait_for_function(
            "hash => window.mjplug.app.stage.worlds.get(0).info.scene === hash", arg=server.hash
        )
        page.show()
        stats = page.stats()
        return [stats[name] for name in ("meshes", "geometries", "textures")]

    loaded = [load(model) for model in (second, first, second, first, second, first)]
    assert loaded[0] == loaded[2] == loaded[4]
    assert loaded[1] == loaded[3] == loaded[5]
    assert color_at(page, point(page, "red"))[0] > 120


def test_several_servers_share_a_scene(studio):
    page = studio(boxes(), boxes())
    page.send({"op": "info", "server": 1, "info": page.servers[1].info()})
    page.page.wait_for_function("window.mjplug.app.stage.worlds.size === 2")
    page.redraw("stage.setOffset(1, [0, 1, 0])")
    page.show(0)
    page.show(1)
    assert page.evaluate("[...stage.worlds.values()].map(({name}) => name)") == ["/robot0/mjplug", "/robot1/mjplug"]
    page.redraw("stage.fit()")
    assert color_at(page, point(page, "red", 1))[0] > 120
    assert color_at(page, point(page, "green", 0))[1] > 120
    first, second = (page.evaluate(f"stage.worlds.get({i}).bodyPoint(1).toArray()") for i in (0, 1))
    assert np.subtract(second, first) == pytest.approx([0, 1, 0])
    page.redraw("stage.remove(1)")
    assert page.evaluate("stage.worlds.size") == 1


def test_a_server_that_is_hidden_while_its_model_is_loaded_stays_hidden(studio):
    page = studio(boxes(), boxes())
    page.evaluate(
        """((source) => {
            const scene = source.scene.bind(source);
            source.scene = (hash) => {
                const released = new Promise((release) => (window.release = release));
                return (window.loaded = released.then(() => scene(hash)));
            };
        })(stage.source)"""
    )
    page.evaluate("window.mjplug.app.servers.show(1, true)")
    page.page.wait_for_function("window.release !== undefined")
    page.evaluate("window.mjplug.app.servers.show(1, false)")
    # The model has no textures, so only promises that are already resolved are awaited after it is loaded.
    page.page.evaluate("(window.release(), window.loaded.then(() => new Promise((done) => setTimeout(done, 50))))")
    assert page.evaluate("stage.worlds.size") == 1


def test_a_body_of_a_server_that_is_hidden_is_neither_selected_nor_followed(studio):
    page = studio(boxes(), boxes())
    page.evaluate("window.mjplug.app.servers.show(1, true)")
    page.page.wait_for_function("window.mjplug.app.stage.worlds.size === 2")
    page.evaluate("window.mjplug.app.selection.select({ world: stage.worlds.get(1), body: 1 })")
    page.page.get_by_role("button", name="Follow the selected body", exact=True).click()
    assert page.evaluate("stage.viewpoint.followed.world.server") == 1
    page.evaluate("window.mjplug.app.servers.show(1, false)")
    assert page.evaluate("window.mjplug.app.selection.current") is None
    assert page.evaluate("stage.viewpoint.followed") is None
    page.page.get_by_role("button", name="Follow the selected body", exact=True).wait_for()


def test_a_reset_is_shown_at_once(studio):
    server = Server(boxes())
    page = studio(server)
    page.show(wall_time=100.0)
    server.data.qpos[0] = 1.5
    server.epoch += 1
    mujoco.mj_forward(server.model, server.data)
    page.show(wall_time=100.01)
    assert page.evaluate("world.bodies[1].position.x") == pytest.approx(1.5)
    assert not page.evaluate("world.motion.moving")


def test_without_webgl_the_page_says_so(browser):
    context = browser.new_context()
    page = context.new_page()
    page.add_init_script(
        "const original = HTMLCanvasElement.prototype.getContext;"
        "HTMLCanvasElement.prototype.getContext = function (kind, ...rest) {"
        " return kind.startsWith('webgl') ? null : original.call(this, kind, ...rest); }"
    )
    from view.studio import ADDRESS, PAGE

    page.route("**/*", lambda route: route.fulfill(path=PAGE / (route.request.url[len(ADDRESS) :] or "index.html")))
    page.goto(ADDRESS)
    page.get_by_text("This browser offers no WebGL 2").wait_for()
    assert page.evaluate("window.mjplug.stats().drawn") == 0
    context.close()


def test_a_lost_graphics_context_is_reported_and_restored(studio):
    page = studio(boxes())
    page.show()
    before = color_at(page, point(page, "red"))
    page.page.evaluate(
        """() => {
            window.lost = window.mjplug.app.stage.renderer.getContext().getExtension("WEBGL_lose_context");
            window.lost.loseContext();
        }"""
    )
    message = page.page.get_by_text("The graphics card has reset")
    message.wait_for()
    page.page.evaluate("setTimeout(() => window.lost.restoreContext(), 0)")
    message.wait_for(state="hidden")
    page.redraw()
    assert before[0] > 120
    assert color_at(page, point(page, "red")) == pytest.approx(before, abs=3)
    page.errors.clear()
