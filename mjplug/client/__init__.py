"""A Python client of mjplug servers: typed topics, services and actions by their ROS names, on any machine.

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
    GoalFailed,
    NoServerError,
    RequestRefused,
    TimedOutError,
    UnknownNameError,
    WrongTypeError,
)
from mjplug.client.failure import DEFAULT_ENDPOINT
from mjplug.client.goal import Goal
from mjplug.client.publisher import Publisher
from mjplug.client.subscription import MessageInfo, Subscription
from mjplug.wire.discovery.format import ActionInfo, ServerInfo, ServiceInfo, TopicInfo

__all__ = [
    "DEFAULT_ENDPOINT",
    "ActionInfo",
    "Client",
    "ClientError",
    "Goal",
    "GoalFailed",
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
