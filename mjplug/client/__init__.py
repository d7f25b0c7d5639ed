"""A Python client of mjplug servers: topics and services by their ROS names, typed, on this machine or another.

It needs Zenoh and `mjplug_schemas`, and imports neither MuJoCo nor numpy:

    from mjplug.client import connect

    with connect() as client:
        print(client.call("~/set_pause", paused=False).message)
        for clock in client.subscribe("/clock"):
            print(clock.clock.sec)
"""

from mjplug.client.client import Client
from mjplug.client.connection import connect
from mjplug.client.errors import (
    ClientError,
    NoServerError,
    RequestRefused,
    TimedOutError,
    UnknownNameError,
    WrongTypeError,
)
from mjplug.client.failure import DEFAULT_ENDPOINT
from mjplug.client.publisher import Publisher
from mjplug.client.subscription import MessageInfo, Subscription
from mjplug.wire.discovery.format import ServerInfo, ServiceInfo, TopicInfo

__all__ = [
    "DEFAULT_ENDPOINT",
    "Client",
    "ClientError",
    "MessageInfo",
    "NoServerError",
    "Publisher",
    "RequestRefused",
    "ServerInfo",
    "ServiceInfo",
    "Subscription",
    "TimedOutError",
    "TopicInfo",
    "UnknownNameError",
    "WrongTypeError",
    "connect",
]
