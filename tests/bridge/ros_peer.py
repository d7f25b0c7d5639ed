"""A ROS node controlled by the tests, in ROS's Python, because the tests' Python or numpy may be too new for rclpy.

Reads orders from the connection in `ROS_PEER`: a number, a verb and its arguments. Writes what each of them returns,
and the news that come of it later, which are messages and responses, with its number.
"""

import contextlib
import os
import re
import sys
import threading
from multiprocessing.connection import Client

import rclpy
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from mjplug_bridge_ros2.ros_types import import_type


class Peer:
    def __init__(self):
        self._connection = Client(os.environ["ROS_PEER"])
        self._writing = threading.Lock()
        self._entities = {}
        rclpy.init(args=sys.argv)
        self._node = rclpy.create_node("user")
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self._node)

    def run(self):
        threading.Thread(target=self._obey, daemon=True).start()
        with contextlib.suppress(ExternalShutdownException, KeyboardInterrupt):
            self._executor.spin()

    def _obey(self):
        while True:
            try:
                number, verb, arguments = self._connection.recv()
            except EOFError:
                rclpy.shutdown()
                return
            self._write(number, "done", getattr(self, verb)(number, *arguments))

    def _tell(self, number, news):
        self._write(number, "news", news)

    def _write(self, *answer):
        with self._writing:
            self._connection.send(answer)

    def subscribe(self, number, name, type_name, reliable, latched):
        made = self._node.create_subscription(
            import_type(type_name), name, lambda payload: self._tell(number, payload), _qos(reliable, latched), raw=True
        )
        self._entities[number] = (self._node.destroy_subscription, made)

    def publisher(self, number, name, type_name):
        made = self._node.create_publisher(import_type(type_name), name, _qos(True, False))
        self._entities[number] = (self._node.destroy_publisher, made)

    def readers(self, number, publisher):
        return self._entities[publisher][1].get_subscription_count()

    def publish(self, number, publisher, payload):
        self._entities[publisher][1].publish(payload)

    def client(self, number, name, type_name):
        made = self._node.create_client(import_type(type_name), name)
        self._entities[number] = (self._node.destroy_client, made)

    def ready(self, number, client):
        return self._entities[client][1].service_is_ready()

    def send(self, number, client, type_name, fields):
        request = import_type(type_name).Request()
        _set(request, fields)
        future = self._entities[client][1].call_async(request)
        future.add_done_callback(lambda future: self._tell(number, _scalars(future.result())))

    def types(self, number, name):
        return dict(self._node.get_topic_names_and_types()).get(name, [])

    def leave(self, number):
        rclpy.shutdown()

    def forget(self, number):
        for destroy, entity in self._entities.values():
            destroy(entity)
        self._entities.clear()


def _qos(reliable, latched):
    return QoSProfile(
        depth=10,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )


def _set(message, fields):
    types = message.get_fields_and_field_types()
    for name, value in fields.items():
        if isinstance(value, dict):
            _set(getattr(message, name), value)
        elif isinstance(value, list) and value and isinstance(value[0], dict):
            package, element = re.fullmatch(r"sequence<(\w+)/(\w+)>", types[name]).groups()
            elements = [import_type(f"{package}/msg/{element}")() for _ in value]
            for made, content in zip(elements, value, strict=True):
                _set(made, content)
            setattr(message, name, elements)
        else:
            setattr(message, name, value)


def _scalars(message):
    values = {name: getattr(message, name) for name in message.get_fields_and_field_types()}
    return {name: value for name, value in values.items() if isinstance(value, (bool, int, float, str))}


if __name__ == "__main__":
    Peer().run()
