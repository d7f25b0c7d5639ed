"""Publishers, subscriptions, services and clients. Nodes make them."""

import threading
import time
import uuid

from rclpy import _cdr
from rclpy._context import context
from rclpy.exceptions import InvalidHandle
from rclpy.task import Future


class Entity:
    def __init__(self, node, callback_group):
        self.id = uuid.uuid4().hex
        self.callback_group = callback_group
        self.destroyed = False
        self._node = node

    def _announce(self, kind, name, interface, *rest):
        context.handle(self.id, self._told)
        context.send(kind, self.id, name, interface.TYPE, *rest)

    def _told(self, kind, *data):
        raise NotImplementedError

    def _check(self):
        if self.destroyed:
            raise InvalidHandle(f"cannot use a {type(self).__name__} that was destroyed")

    def _destroy(self):
        self._check()
        self.destroyed = True
        context.handle(self.id, None)
        context.send("gone", self.id)


class Publisher(Entity):
    def __init__(self, node, msg_type, topic, qos, group):
        super().__init__(node, group)
        self.msg_type = msg_type
        self._readers = 0
        self._announce("publisher", topic, msg_type, *qos.wire)

    def publish(self, msg):
        self._check()
        if isinstance(msg, self.msg_type):
            msg = _cdr.serialize(msg)
        elif not isinstance(msg, bytes):
            raise TypeError(f"Expected {self.msg_type}, got {type(msg)}")
        if not context.ok:
            raise RuntimeError("publisher's context is invalid")
        # Cyclone DDS gives a raw subscription the bytes with zeros up to a multiple of 4.
        context.send("publish", self.id, msg + bytes(-len(msg) % 4))

    def get_subscription_count(self):
        self._check()
        return self._readers

    def _told(self, kind, readers):
        assert kind == "matched"
        self._readers = readers


class Subscription(Entity):
    def __init__(self, node, msg_type, topic, callback, qos, group, raw):
        super().__init__(node, group)
        self._callback, self._type, self._raw = callback, msg_type, raw
        self._announce("subscription", topic, msg_type, *qos.wire)

    def _told(self, kind, message):
        assert kind == "message"
        given = message if self._raw else _cdr.deserialize(message, self._type)
        self._node._executor._submit(self, self._callback, given)


class Service(Entity):
    def __init__(self, node, srv_type, srv_name, callback, group):
        super().__init__(node, group)
        self._callback, self._type = callback, srv_type
        self._announce("service", srv_name, srv_type)

    def _told(self, kind, token, payload):
        assert kind == "request"
        request = _cdr.deserialize(payload, self._type.Request)

        def respond(response):
            self._check()
            if type(response) is not self._type.Response:
                raise TypeError(f"Expected {self._type.Response}, got {type(response)}")
            context.send("response", self.id, token, _cdr.serialize(response))

        self._node._executor._submit(self, self._callback, request, self._type.Response(), then=respond)


class Client(Entity):
    def __init__(self, node, srv_type, srv_name, group):
        super().__init__(node, group)
        self._type = srv_type
        self._waiting = {}
        self._available = False
        self._changed = threading.Condition()
        self._announce("client", srv_name, srv_type)

    def call_async(self, request):
        self._check()
        if type(request) is not self._type.Request:
            raise TypeError(f"Expected {self._type.Request}, got {type(request)}")
        future = Future(executor=self._node._executor)
        number = len(self._waiting)
        self._waiting[number] = future
        context.send("request", self.id, number, _cdr.serialize(request))
        return future

    def service_is_ready(self):
        return self._available

    def wait_for_service(self, timeout_sec=None):
        until = None if timeout_sec is None else time.monotonic() + timeout_sec
        with self._changed:
            while not self._available:
                if not self._changed.wait(None if until is None else until - time.monotonic()):
                    return False
        return True

    def _told(self, kind, *data):
        if kind == "available":
            with self._changed:
                self._available = data[0]
                self._changed.notify_all()
        else:
            number, payload = data
            future = self._waiting[number]
            self._node._executor.create_task(future.set_result, _cdr.deserialize(payload, self._type.Response))


class Timer:
    destroyed = False

    def __init__(self, period, callback, group):
        self.period, self.callback, self.callback_group = period, callback, group
        self.due = time.monotonic() + period
