"""Adding and removing entities on a running server: worker processes, the view, and clients."""

import json
import queue
import time

import pytest
from services.view_packs import Frame
from standard_worlds import CUP, DOOR
from wire.conftest import Client

from mjplug import open_server
from mjplug.client import ClientError
from mjplug_schemas.mjplug_msgs import ModelChanged
from mjplug_schemas.sensor_msgs import LaserScan

WAIT = 60.0
"""How long anything may take on a machine with other work [s]."""

SCENE = """
<mujoco model="hall">
  <option timestep="0.002" gravity="0 0 0"/>
  <worldbody>
    <geom name="far" type="box" size=".1 5 5" pos="6 0 0"/>
    <site name="eye"/>
    <body name="ball" pos="0 3 0"><freejoint/><geom size=".1"/></body>
  </worldbody>
</mujoco>
"""
WALL = "<mujoco><worldbody><geom type='box' size='.1 2 2'/></worldbody></mujoco>"
LIDAR = {
    "type": "lidar",
    "top": {"site": "eye", "resolution": [3, 1], "azimuth_range": [-0.1, 0.1], "elevation_range": [0.0],
            "max_range": 20.0, "update_rate": 50.0, "topic": "/scan"},
}  # fmt: skip


@pytest.fixture
def server(tmp_path):
    (tmp_path / "hall.xml").write_text(SCENE)
    (tmp_path / "cup.xml").write_text(CUP)
    settings = {"simulation_interfaces.spawnables": [str(tmp_path)]}
    with open_server(tmp_path / "hall.xml", plugins={"lidar": LIDAR}, settings=settings) as opened:
        yield opened


def call(client, service, **fields):
    response = client.call(f"/{service}", fields, timeout=WAIT)
    assert response.result.result == 1, response.result.error_message
    return response


def until(get, wanted):
    """Waits for a value that satisfies a condition; returns it."""
    end = time.monotonic() + WAIT
    while time.monotonic() < end:
        value = get(timeout=WAIT)
        if wanted(value):
            return value
    raise AssertionError("the wanted value did not come in time")


def test_a_lidar_in_a_worker_process_sees_what_was_added_and_removed(server):
    with server.client() as client, client.subscribe("/scan", LaserScan) as scans:

        def distance(timeout):
            return next(iter(scans)).ranges[1]

        assert until(distance, lambda value: value == pytest.approx(5.9, abs=0.01))
        pose = {"pose": {"position": {"x": 2.0}, "orientation": {"w": 1.0}}}
        call(client, "spawn_entity", name="wall", entity_resource={"resource_string": WALL}, initial_pose=pose)
        assert until(distance, lambda value: value == pytest.approx(1.9, abs=0.01))
        call(client, "delete_entity", entity="wall")
        assert until(distance, lambda value: value == pytest.approx(5.9, abs=0.01))


def test_viewers_get_the_new_drawing_pack_and_its_frames(server):
    viewer = Client(server.endpoint)
    try:
        infos, frames = queue.Queue(), viewer.listen("mjplug/@view/frame")
        subscriber = viewer.session.declare_subscriber(
            "mjplug/@view/info", lambda sample: infos.put(json.loads(bytes(sample.payload)))
        )
        (first,) = viewer.session.get("mjplug/@view/info", timeout=WAIT)
        before = json.loads(bytes(first.ok.payload))
        frame = Frame(bytes(frames.get(timeout=WAIT).payload))
        with server.client() as client:
            call(client, "spawn_entity", name="mug", entity_resource={"uri": "cup.xml"})
            after = until(infos.get, lambda info: info["scene"] != before["scene"])
            assert (before["model_generation"], after["model_generation"]) == (0, 1)
            (packed,) = viewer.session.get("mjplug/@view/scene", timeout=WAIT)
            assert packed.ok.attachment.to_string() == after["scene"]
            moving = len(frame.bodies) + 1
            until(lambda timeout: Frame(bytes(frames.get(timeout=timeout).payload)), lambda f: len(f.bodies) == moving)
            call(client, "delete_entity", entity="mug")
            again = until(infos.get, lambda info: info["model_generation"] == 2)
            assert again["scene"] == before["scene"]
        subscriber.undeclare()
    finally:
        viewer.close()


def test_clients_hear_of_changes_and_late_ones_of_the_last(server):
    with server.client() as client:
        call(client, "spawn_entity", name="door", entity_resource={"resource_string": DOOR})
        with client.subscribe("~/model_changed", ModelChanged) as changes:
            assert next(iter(changes)).added == ("door",)


def test_a_client_that_disappears_during_its_request_leaves_a_whole_entity(server):
    with server.client() as client:
        impatient = Client(server.endpoint)
        request = {"name": "mug", "entity_resource": {"resource_string": CUP}}
        impatient.session.get("spawn_entity", payload=json.dumps(request), timeout=WAIT)
        impatient.close()
        end = time.monotonic() + WAIT
        while "mug" not in call(client, "get_entities").entities and time.monotonic() < end:
            time.sleep(0.05)
        call(client, "delete_entity", entity="mug")
        assert call(client, "get_entities").entities == ("ball",)


def test_an_invalid_request_gets_a_typed_response(server):
    viewer = Client(server.endpoint)
    try:
        (answer,) = viewer.session.get("spawn_entity", payload='{"nam": "x"}', timeout=WAIT)
        result = json.loads(bytes(answer.ok.payload))["result"] if answer.ok else None
        assert answer.ok is None or result["result"] == 4
        with server.client() as client, pytest.raises(ClientError, match="unknown field"):
            client.call("/spawn_entity", nam="x")
    finally:
        viewer.close()
