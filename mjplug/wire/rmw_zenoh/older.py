"""Requests of ROS 2 nodes with older definitions of a service: simulation_interfaces 1.4 to 1.6, before version 2.

The key of a request contains the hash of its definition. The request is converted to the present definition, and its
response back.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

import zenoh

from mjplug.wire.encoding import Form, Received
from mjplug.wire.rmw_zenoh.keys import NO_HASH, Distro
from mjplug.wire.rmw_zenoh.raw_request import RmwRequest
from mjplug_schemas.errors import CodecError
from mjplug_schemas.message import Message, Service
from mjplug_schemas.rihs01 import type_hash

_PRESENT: tuple[Distro, ...] = ("lyrical", "rolling")
"""Distributions with version 2."""


@dataclass(frozen=True, slots=True)
class Older:
    """An older definition of a service.

    Attributes:
        old: Its class.
        present: The class of the present definition.
        upgrade: Converts a request to the present definition.
        downgrade: Converts a response to the older definition.
    """

    old: type[Service]
    present: type[Service]
    upgrade: Callable[[Any], Message]
    downgrade: Callable[[Any], Message]

    def applies(self, key: str, distro: Distro) -> bool:
        """Returns whether a request with this key has the older definition."""
        # Any: mypy does not accept a class as a hashable argument of a cached function.
        older: Any = self.old
        chunk = key.rpartition("/")[2]
        return chunk == type_hash(older) or (chunk == NO_HASH and distro not in _PRESENT)

    def is_announced(self, distro: Distro) -> bool:
        """Returns whether the nodes of a distribution have the older definition."""
        return distro not in _PRESENT


class OlderRequest:
    """A request with an older definition. Implements `mjplug.wire.dialect.RawRequest`.

    Args:
        request: The request as it was received.
        older: Its definition.
    """

    needs_response = True

    def __init__(self, request: RmwRequest, older: Older) -> None:
        self.size = request.size
        self.parameters: Mapping[str, str] = request.parameters
        self._request = request
        self._older = older
        payload = request.received.payload
        try:
            old = older.old.Request.from_cdr(b"" if payload is None else bytes(payload))
        except CodecError as error:
            self.received = Received(None, None, "cdr", str(error))
        else:
            self.received = Received(zenoh.ZBytes(older.upgrade(old).to_cdr()), None, "cdr")

    def reply(self, payload: bytes, form: Form) -> None:
        """Sends the response in the older definition."""
        response = self._older.present.Response.from_cdr(payload)
        self._request.reply(self._older.downgrade(response).to_cdr(), form)

    def reply_error(self, sentence: str) -> None:
        """Sends an error reply."""
        self._request.reply_error(sentence)


def older_definition(service: type[Service]) -> Older | None:
    """Returns the older definition of a service; None if it has none."""
    return _all().get(service.TYPE) if service.TYPE.startswith("simulation_interfaces/") else None


@cache
def _all() -> Mapping[str, Older]:
    # Imported here, because the classes take a tenth of a second.
    from mjplug_schemas import simulation_interfaces as new  # noqa: PLC0415
    from mjplug_schemas import simulation_interfaces_1 as old  # noqa: PLC0415

    def set_entity_state(request: Any) -> Message:
        return new.SetEntityState.Request(
            entity=request.entity, state=request.state, set_pose=True, set_twist=True, set_acceleration=True
        )

    def resource(request: Any) -> Any:
        return new.Resource(uri=request.uri, resource_string=request.resource_string)

    def spawn_entity(request: Any) -> Message:
        return new.SpawnEntity.Request(
            name=request.name,
            allow_renaming=request.allow_renaming,
            entity_resource=resource(request),
            entity_namespace=request.entity_namespace,
            initial_pose=request.initial_pose,
        )

    def load_world(request: Any) -> Message:
        return new.LoadWorld.Request(
            world_resource=resource(request),
            fail_on_unsupported_element=request.fail_on_unsupported_element,
            ignore_missing_or_unsupported_assets=request.ignore_missing_or_unsupported_assets,
        )

    def spawnables(response: Any) -> Message:
        # A model without an address cannot be expressed.
        listed = tuple(
            old.Spawnable(uri=item.entity_resource.uri, description=item.description, spawn_bounds=item.spawn_bounds)
            for item in response.spawnables
            if item.entity_resource.uri
        )
        return old.GetSpawnables.Response(result=response.result, spawnables=listed)

    def same(message: Message) -> Message:
        return message

    def get_spawnables(request: Any) -> Message:
        return new.GetSpawnables.Request(sources=request.sources)

    found = (
        Older(old.SetEntityState, new.SetEntityState, set_entity_state, same),
        Older(old.SpawnEntity, new.SpawnEntity, spawn_entity, same),
        Older(old.LoadWorld, new.LoadWorld, load_world, same),
        Older(old.GetSpawnables, new.GetSpawnables, get_spawnables, spawnables),
    )
    return {older.old.TYPE: older for older in found}
