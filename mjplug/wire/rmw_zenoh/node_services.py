"""Declares `get_type_description`, the service of every ROS 2 node in addition to the parameter services."""

from typing import Any

from mjplug.contracts.transport import Call, ServiceName
from mjplug.wire.calls import OpenCalls
from mjplug.wire.rmw_zenoh.descriptions import TypeDescriptions
from mjplug.wire.rmw_zenoh.dialect import RmwZenohDialect
from mjplug.wire.rmw_zenoh.keys import RosSettings
from mjplug.wire.service import ServiceServer
from mjplug_schemas.type_description_interfaces import GetTypeDescription


def offer_node_services(dialect: RmwZenohDialect, name: str, settings: RosSettings, open_calls: OpenCalls) -> None:
    """Declares the service, for ROS 2 nodes only. It is served on Zenoh's threads, not on the physics thread.

    Args:
        dialect: The rmw_zenoh dialect.
        name: The node's full name.
        settings: The ROS 2 domain and distribution.
        open_calls: The open calls of the session.
    """
    if settings.distro == "humble":
        # Nodes of Humble do not have this service.
        return
    descriptions = TypeDescriptions(dialect.types)

    def answer(call: Call) -> None:
        # Any, because the protocol `Call` does not state the type, which the decoder has checked.
        request: Any = call.request
        call.respond(descriptions.answer(request))

    service = ServiceName(f"{name}/get_type_description", GetTypeDescription)
    dialect.declare_service(service, ServiceServer(service, answer, open_calls).receive)
