"""The service that every ROS 2 node has beside its parameters: the description of its types."""

from typing import Any

from mjplug.contracts.transport import Call, ServiceName
from mjplug.wire.calls import OpenCalls
from mjplug.wire.rmw_zenoh.descriptions import TypeDescriptions
from mjplug.wire.rmw_zenoh.dialect import RmwZenohDialect
from mjplug.wire.rmw_zenoh.keys import RosSettings
from mjplug.wire.service import ServiceServer
from mjplug_schemas.type_description_interfaces import GetTypeDescription


def offer_node_services(dialect: RmwZenohDialect, name: str, settings: RosSettings, open_calls: OpenCalls) -> None:
    """Declares the service, for ROS 2 nodes only; it answers on Zenoh's threads, without the simulation.

    Args:
        dialect: Where to declare it.
        name: The node's full name.
        settings: The distribution.
        open_calls: Where calls wait for their answers to be sent.
    """
    if settings.distro == "humble":
        # Humble has no such service.
        return
    descriptions = TypeDescriptions(dialect.types)

    def answer(call: Call) -> None:
        # The service has decoded it as what it is.
        request: Any = call.request
        call.respond(descriptions.answer(request))

    service = ServiceName(f"{name}/get_type_description", GetTypeDescription)
    dialect.declare_service(service, ServiceServer(service, answer, open_calls).receive)
