"""Declares the keys of the simulation view below `<server>/@view/`."""

import json
from collections.abc import Mapping
from functools import partial

from mjplug.contracts.transport import BytesPublisher, BytesQuery, Transport
from mjplug.contracts.work import WorkerPool
from mjplug.physics.loop import Loop
from mjplug.physics.model_change import ModelChange
from mjplug.services.view.answers import MadeOnce
from mjplug.services.view.drag_message import MAX_BYTES
from mjplug.services.view.drags import Drags
from mjplug.services.view.feed import Feed
from mjplug.services.view.work import MODEL, SCENE, Report, SavedModel, Scene

_BYTES, _JSON, _GZIP = "application/octet-stream", "application/json", "application/gzip"


def offer(loop: Loop, transport: Transport, workers: WorkerPool, key: str, plugins: Mapping[str, str]) -> None:
    """Declares `info`, `scene`, `model`, `frame`, `state`, `overlay/<kind>` and `drag`.

    Call it before plugins start, so that their forces are added to those of drags.

    Args:
        loop: The physics loop.
        transport: Declares the keys.
        workers: Runs the worker process that makes the drawing pack and the frames.
        key: Zenoh key of the server, such as `robot1/mjplug`.
        plugins: Type of each plugin instance, by instance name.
    """
    view = f"{key}/@view"
    scene: MadeOnce[Scene] = MadeOnce(loop.inbox, "drawing pack")
    model: MadeOnce[SavedModel] = MadeOnce(loop.inbox, "saved model")
    info = _Info(loop, key, plugins)
    drags = Drags(loop)

    def made(report: Report) -> None:
        if isinstance(report, Scene):
            scene.made(report)
            # Viewers of a changed model get its drawing pack.
            info.publish_changes(publisher, report)
        else:
            model.made(report)

    feed = Feed(
        loop,
        workers,
        lambda name, on_matched: transport.open_bytes_publisher(f"{view}/{name}", _BYTES, on_matched),
        lambda: drags.grips,
        made,
        lambda task, reason: scene.lost(reason) if task == SCENE else model.lost(reason),
    )
    request_scene = partial(feed.request, SCENE)

    def reply_info(query: BytesQuery, value: Scene) -> None:
        query.reply(info.describe(value), _JSON)

    def reply_scene(query: BytesQuery, value: Scene) -> None:
        query.reply(value.pack, _GZIP, value.sha256)

    def reply_model(query: BytesQuery, value: SavedModel) -> None:
        query.reply(value.mjb, _GZIP, value.mujoco)

    transport.open_bytes_queryable(f"{view}/info", lambda query: scene.answer(query, reply_info, request_scene))
    transport.open_bytes_queryable(f"{view}/scene", lambda query: scene.answer(query, reply_scene, request_scene))
    request_model = partial(feed.request, MODEL)
    transport.open_bytes_queryable(f"{view}/model", lambda query: model.answer(query, reply_model, request_model))
    publisher = transport.open_bytes_publisher(f"{view}/info", _JSON, lambda: None)

    def model_changed(change: ModelChange) -> None:
        known = scene.value is not None
        scene.forget()
        model.forget()
        feed.model_changed(change)
        if known and publisher.matched:
            request_scene()

    loop.on_model_changed.append(model_changed)
    loop.on_second.append(lambda now: info.publish_changes(publisher, scene.value))
    transport.open_bytes_subscription(f"{view}/drag", MAX_BYTES, drags.receive)
    transport.watch_leaving(f"{view}/viewer/*", lambda token: drags.left(token.rpartition("/")[2]))


class _Info:
    """The description of the model and of the state of the simulation."""

    def __init__(self, loop: Loop, key: str, plugins: Mapping[str, str]) -> None:
        self._loop = loop
        self._key = key
        self._plugins = dict(plugins)
        self._published: object = None

    def publish_changes(self, publisher: BytesPublisher, scene: Scene | None) -> None:
        """Publishes the description if it has changed apart from the time, and has a subscriber. Physics thread."""
        if scene is None or not publisher.matched:
            return
        loop = self._loop
        state = loop.simulation.epoch, loop.simulation.generation, loop.paused, loop.pacer.speed
        if state != self._published:
            self._published = state
            publisher.put(self.describe(scene))

    def describe(self, scene: Scene) -> bytes:
        """Returns the description, in JSON. Any thread."""
        loop = self._loop
        info = {
            "name": f"/{self._key}",
            "scene": scene.sha256,
            "scene_bytes": len(scene.pack),
            "timestep": float(loop.simulation.time.timestep),
            "epoch": loop.simulation.epoch,
            "step": loop.simulation.step,
            "model_generation": loop.simulation.generation,
            "paused": loop.paused,
            "speed": loop.pacer.speed,
            "plugins": self._plugins,
        }
        # The catalogue is long, so it is encoded only once.
        return b"%b,%b" % (json.dumps(info, separators=(",", ":")).encode()[:-1], scene.catalogue[1:])
