"""Publishes `~/model_changed` after each change of the model."""

from mjplug.physics.model_change import ModelChange
from mjplug.plugin import LATCHED, Host
from mjplug.services.standard.world_builder import WorldBuilder
from mjplug_schemas.mjplug_msgs import ModelChanged


def offer(host: Host, builder: WorldBuilder, digest: str) -> None:
    """Declares the latched topic.

    Args:
        host: The host of the server.
        builder: Changes the model.
        digest: Identifies the model at the start.
    """
    publisher = host.create_publisher(ModelChanged, "~/model_changed", LATCHED)

    def publish(change: ModelChange) -> None:
        publisher.publish(
            ModelChanged(
                generation=change.generation,
                stamp=host.now(),
                added=change.added,
                removed=change.removed,
                model_digest=change.digest,
            )
        )

    publisher.publish(ModelChanged(model_digest=digest))
    builder.on_changed.append(publish)
