"""A ROS 2 peer that shares no code with mjplug: zenoh-ros2-sdk. Says in JSON lines what it sees.

Arguments: the server's port, a folder of interface definitions, the body to push, and topics to publish a Twist on.
"""

import json
import sys
import threading
import time

import zenoh_ros2_sdk.message_registry
from zenoh_ros2_sdk import (
    ROS2Publisher,
    ROS2ServiceClient,
    ROS2Subscriber,
    ZenohSession,
    get_message_class,
    get_registry,
    get_service_names_and_types,
    get_topic_info,
    get_topic_names_and_types,
)

TIMEOUT = 20.0
SERVICE = "/external_wrench/apply_wrench"
TELLING = threading.Lock()


def tell(what, value):
    with TELLING:
        print(json.dumps([what, value]), flush=True)


def make(type_name, **fields):
    return get_message_class(type_name)(**fields)


def vector(x=0.0, z=0.0):
    return make("geometry_msgs/msg/Vector3", x=x, y=0.0, z=z)


def listen(port, topic, type_name, take):
    """Tells the first message of a topic; returns what to keep, and the event of that message."""
    first = threading.Event()

    def heard(message):
        if not first.is_set():
            tell(topic, take(message))
            first.set()

    return ROS2Subscriber(topic, type_name, heard, router_port=port), first


def steer(port, topic):
    """Publishes one Twist as soon as a subscriber is matched."""
    publisher = ROS2Publisher(topic, "geometry_msgs/msg/Twist", router_port=port)
    tick = threading.Event()
    while not publisher.pub.matching_status.matching:
        tick.wait(0.005)
    publisher.publish(linear=vector(x=0.5), angular=vector(z=-1.0))
    return publisher


def push(port, body):
    """Calls a service that answers when the push is over."""
    client = ROS2ServiceClient(
        SERVICE,
        "mujoco_ros2_control_msgs/srv/ApplyExternalWrench",
        router_port=port,
        timeout=TIMEOUT,
    )
    none = make("builtin_interfaces/msg/Time", sec=0, nanosec=0)
    header = make("std_msgs/msg/Header", stamp=none, frame_id=body)
    force = make("geometry_msgs/msg/Wrench", force=vector(1.0), torque=vector())
    wrench = make(
        "mujoco_ros2_control_msgs/msg/ExternalWrench",
        header=header,
        wrench=make("geometry_msgs/msg/WrenchStamped", header=header, wrench=force),
        application_point=make("geometry_msgs/msg/Point", x=0.0, y=0.0, z=0.0),
        duration=make("builtin_interfaces/msg/Duration", sec=0, nanosec=300_000_000),
        ramp_down_duration=make("builtin_interfaces/msg/Duration", sec=0, nanosec=0),
    )
    response = client.call(
        wrenches=make("mujoco_ros2_control_msgs/msg/ExternalWrenchArray", external_wrenches=[wrench])
    )
    return [bool(response.success), response.message]


def asked(ask, name):
    """Asks again while the answer has nothing by that name: a Zenoh peer that connects to one more may get no reply."""
    tick = threading.Event()
    deadline = time.monotonic() + TIMEOUT
    while not (answer := ask()).get(name) and time.monotonic() < deadline:
        tick.wait(0.05)
    return answer


def main():
    port, tree, body, *twist_topics = sys.argv[1:]
    port = int(port)
    # It would look for definitions on the internet.
    zenoh_ros2_sdk.message_registry.get_repository_for_package = lambda package: None
    get_registry(tree)
    session = ZenohSession.get_instance("127.0.0.1", port)
    try:
        heartbeat = listen(port, "/mujoco_heartbeat", "std_msgs/msg/String", lambda message: message.data)
        clock = listen(port, "/clock", "rosgraph_msgs/msg/Clock", lambda message: message.clock.nanosec)
        for _, first in (heartbeat, clock):
            assert first.wait(TIMEOUT)
        kept = [steer(port, topic) for topic in twist_topics]
        tell("response", push(port, body))
        tell("topics", asked(lambda: dict(get_topic_names_and_types(router_port=port)), "/clock"))
        tell("services", asked(lambda: dict(get_service_names_and_types(router_port=port)), SERVICE))
        info = asked(lambda: vars(get_topic_info("/clock", router_port=port, verbose=True)), "publishers")
        (publisher,) = info["publishers"]
        tell("clock publisher", [publisher.node_namespace, publisher.node_name, publisher.qos])
        del kept
    finally:
        session.close()


if __name__ == "__main__":
    main()
