"""The services that every ROS 2 node has and that tools wait for: parameters, and descriptions of types."""

from functools import partial
from typing import Any

from mjplug.transport import Call, ServiceName
from mjplug.wire.calls import OpenCalls
from mjplug.wire.rmw_zenoh.descriptions import TypeDescriptions
from mjplug.wire.rmw_zenoh.dialect import RmwZenohDialect
from mjplug.wire.rmw_zenoh.keys import RosSettings
from mjplug.wire.rmw_zenoh.parameters import Handler, ParameterServices
from mjplug.wire.rmw_zenoh.qos import PARAMETER_SERVICE, SERVICE
from mjplug.wire.service import ServiceServer
from mjplug_schemas.type_description_interfaces import GetTypeDescription


def offer_node_services(dialect: RmwZenohDialect, name: str, settings: RosSettings, open_calls: OpenCalls) -> None:
    """Declares the services, for ROS 2 nodes only; they answer on Zenoh's threads, without the simulation.

    Args:
        dialect: Where to declare them.
        name: The node's full name.
        settings: The distribution and the parameters.
        open_calls: Where calls wait for their answers to be sent.
    """
    offered = [(*offer, PARAMETER_SERVICE) for offer in _named(ParameterServices(settings.parameters).handlers)]
    if settings.distro != "humble":
        # Humble has no such service.
        offered.append(("get_type_description", GetTypeDescription, TypeDescriptions(dialect.types).answer, SERVICE))
    for below, type_, handler, qos in offered:
        service = ServiceName(f"{name}/{below}", type_)
        dialect.open_doors(service, ServiceServer(service, partial(_answer, handler), open_calls).receive, qos)


def _named(handlers: Any) -> list[tuple[str, Any, Handler]]:
    return [(below, type_, handler) for below, (type_, handler) in handlers.items()]


def _answer(handler: Handler, call: Call) -> None:
    call.respond(handler(call.request))
