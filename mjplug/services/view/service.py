"""Declares the keys of the simulation view below `<server>/@view/`."""

import json
from collections.abc import Mapping
from functools import partial

from mjplug.contracts.transport import BytesPublisher, BytesQuery, Transport
from mjplug.contracts.work import WorkerPool
from mjplug.physics.loop import Loop
from mjplug.services.view.drag_message import MAX_BYTES
from mjplug.services.view.drags import Drags
from mjplug.services.view.feed import Feed
from mjplug.services.view.work import Scene

_BYTES, _JSON, _GZIP = "application/octet-stream", "application/json", "application/gzip"


def offer(loop: Loop, transport: Transport, workers: WorkerPool, key: str, plugins: Mapping[str, str]) -> None:
    """Declares `info`, `scene`, `frame`, `overlay/<kind>` and `drag`.

    Call it before plugins start, so that their forces are added to those of drags.

    Args:
        loop: The physics loop.
        transport: Declares the keys.
        workers: Runs the worker process that makes the drawing pack and the frames.
        key: Zenoh key of the server, such as `robot1/mjplug`.
        plugins: Type of each plugin instance, by instance name.
    """
    view = f"{key}/@view"
    answers = _Answers(loop, key, plugins)
    feed = Feed(
        loop,
        workers,
        lambda name, on_matched: transport.open_bytes_publisher(f"{view}/{name}", _BYTES, on_matched),
        answers.scene_made,
        answers.scene_lost,
    )

    def answer(query: BytesQuery, info: bool) -> None:
        # Without the physics thread, once the scene has been made.
        if not answers.reply(query, info):
            loop.inbox.post(lambda: answers.wait(query, info, feed))

    transport.open_bytes_queryable(f"{view}/info", partial(answer, info=True))
    transport.open_bytes_queryable(f"{view}/scene", partial(answer, info=False))
    publisher = transport.open_bytes_publisher(f"{view}/info", _JSON, lambda: None)
    loop.on_second.append(lambda now: answers.publish_changes(publisher))
    drags = Drags(loop)
    transport.open_bytes_subscription(f"{view}/drag", MAX_BYTES, drags.receive)
    transport.watch_leaving(f"{view}/viewer/*", lambda token: drags.left(token.rpartition("/")[2]))


class _Answers:
    """Answers queries for `info` and `scene`; those before the drawing pack has been made wait for it."""

    def __init__(self, loop: Loop, key: str, plugins: Mapping[str, str]) -> None:
        self._loop = loop
        self._key = key
        self._plugins = dict(plugins)
        self._scene: Scene | None = None
        self._waiting: list[tuple[BytesQuery, bool]] = []
        self._published: object = None

    def reply(self, query: BytesQuery, info: bool) -> bool:
        """Answers a query if the scene has been made; returns whether it was. Any thread."""
        scene = self._scene
        if scene is None:
            return False
        if info:
            query.reply(self._info(scene), _JSON)
        else:
            query.reply(scene.pack, _GZIP, scene.sha256)
        return True

    def wait(self, query: BytesQuery, info: bool, feed: Feed) -> None:
        """Answers a query now, or lets it wait for the scene. Physics thread."""
        if self.reply(query, info):
            return
        self._waiting.append((query, info))
        if len(self._waiting) == 1:
            feed.request_scene()

    def scene_made(self, scene: Scene) -> None:
        """Answers the queries that wait."""
        self._scene = scene
        waiting, self._waiting = self._waiting, []
        for query, info in waiting:
            self.reply(query, info)

    def scene_lost(self, reason: str) -> None:
        """Refuses the queries that wait."""
        waiting, self._waiting = self._waiting, []
        for query, _ in waiting:
            query.refuse(f"the drawing pack cannot be made: {reason}")

    def publish_changes(self, publisher: BytesPublisher) -> None:
        """Publishes the description if it has changed apart from the time, and has a subscriber. Physics thread."""
        if self._scene is None or not publisher.matched:
            return
        loop = self._loop
        state = loop.simulation.epoch, loop.paused, loop.pacer.speed
        if state != self._published:
            self._published = state
            publisher.put(self._info(self._scene))

    def _info(self, scene: Scene) -> bytes:
        loop = self._loop
        info = {
            "name": f"/{self._key}",
            "scene": scene.sha256,
            "scene_bytes": len(scene.pack),
            "timestep": float(loop.simulation.time.timestep),
            "epoch": loop.simulation.epoch,
            "step": loop.simulation.step,
            "paused": loop.paused,
            "speed": loop.pacer.speed,
            "plugins": self._plugins,
        }
        # The catalogue is long, so it is encoded only once.
        return b"%b,%b" % (json.dumps(info, separators=(",", ":")).encode()[:-1], scene.catalogue[1:])
