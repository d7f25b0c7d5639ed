"""Who can publish the model of a server with roles."""

import threading

import pytest
import zenoh
from security.conftest import Client
from zenoh.ext import CacheConfig, declare_advanced_publisher

from mjplug.server.open_server import open_server
from mjplug.wire.endpoints import with_free_port

pytestmark = pytest.mark.timeout(240)

BALL = '<mujoco model="{0}"><worldbody><body><joint/><geom name="{0}" size=".1"/></body></worldbody></mujoco>'


def test_a_server_with_roles_takes_the_model_of_an_operator_and_not_that_of_a_viewer(
    keys, opened, tmp_path, monkeypatch
):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    endpoint = with_free_port("tls/127.0.0.1:0")
    found, failed = [], []

    def run():
        try:
            config = keys.path / "server" / "server.json5"
            settings = {"model_timeout": 120.0}
            with open_server(
                "topic:/robot_description", listen=endpoint, zenoh_config=config, settings=settings, run=False
            ) as server:
                found.append(server.model.geom(0).name)
        except BaseException as error:
            failed.append(error)
            raise

    thread = threading.Thread(target=run)
    thread.start()
    viewer = opened(Client(keys.path / "viewer.json5", endpoint, patience_ms=60_000))
    operator = opened(Client(keys.path / "operator.json5", endpoint, patience_ms=60_000))

    def publish(client, name):
        publisher = declare_advanced_publisher(client.session, "robot_description", cache=CacheConfig(1))
        client.keep(publisher)
        publisher.put(BALL.format(name))
        client.session.put("robot_description", BALL.format(name), encoding=zenoh.Encoding.TEXT_PLAIN)

        def answer(query):
            with query:
                query.reply("robot_description", BALL.format(name))

        client.keep(client.session.declare_queryable("robot_description", answer))

    publish(viewer, "from_the_viewer")
    # An answer comes after what was sent before: the server has handled what the viewer sent.
    viewer.ask("robot_description", timeout=2.0)
    thread.join(3.0)
    assert not found
    publish(operator, "from_the_operator")
    thread.join(120.0)
    assert (found, failed) == (["from_the_operator"], [])
