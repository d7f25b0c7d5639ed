import re
import sys
import time

from rclpy import qos_overriding_options
from rclpy._context import context
from rclpy._entities import Client, Publisher, Service, Subscription, Timer
from rclpy._interfaces import Interface
from rclpy.callback_groups import CallbackGroup, MutuallyExclusiveCallbackGroup
from rclpy.clock import Clock, ClockType
from rclpy.exceptions import (
    InvalidParameterTypeException,
    InvalidTopicNameException,
    ParameterAlreadyDeclaredException,
    ParameterNotDeclaredException,
    ParameterUninitializedException,
)
from rclpy.qos import QoSProfile

_NAME = re.compile(r"(/[A-Za-z_][A-Za-z0-9_]*)+")


class Parameter:
    def __init__(self, name, value):
        self.name, self.value = name, value


class Logger:
    def __init__(self, name):
        self._name = name

    def info(self, message):
        self._log("INFO", message)

    def warning(self, message):
        self._log("WARN", message)

    def error(self, message):
        self._log("ERROR", message)

    def fatal(self, message):
        self._log("FATAL", message)

    def _log(self, severity, message):
        if not isinstance(message, str):
            raise TypeError(f"a log message must be a str, not {message!r}")
        print(f"[{severity}] [{time.time():.9f}] [{self._name}]: {message}", file=sys.stderr, flush=True)


class Node:
    """Made by `rclpy.create_node`."""

    def __init__(self, node_name):
        if not context.ok:
            raise RuntimeError("rclpy.init() has not been called")
        self._name = node_name
        self._executor = None
        self._group = MutuallyExclusiveCallbackGroup()
        self._given = context.parameters.get(f"/{node_name}", {})
        self._parameters = {}
        self._logger = Logger(node_name)

    def get_logger(self):
        return self._logger

    def declare_parameter(self, name, value=None):
        if name in self._parameters:
            raise ParameterAlreadyDeclaredException(name)
        given = self._given.get(name, value)
        if given == [] and name in self._given:
            # The parser of ROS gives a list without entries no type, so the parameter is declared without a value.
            self._parameters[name] = Parameter(name, None)
            return self._parameters[name]
        if _kind(given) != _kind(value):
            raise InvalidParameterTypeException(name, _kind(value))
        self._parameters[name] = Parameter(name, given)
        return self._parameters[name]

    def get_parameter(self, name):
        if name not in self._parameters:
            raise ParameterNotDeclaredException(name)
        if self._parameters[name].value is None:
            raise ParameterUninitializedException(name)
        return self._parameters[name]

    def create_publisher(
        self,
        msg_type,
        topic,
        qos_profile,
        *,
        callback_group=None,
        event_callbacks=None,
        qos_overriding_options=None,
    ):
        group, qos = self._check(msg_type, topic, callback_group, event_callbacks), self._qos(qos_profile)
        _override(self, "publisher", topic, qos, qos_overriding_options)
        return Publisher(self, msg_type, topic, qos, group)

    def create_subscription(
        self,
        msg_type,
        topic,
        callback,
        qos_profile,
        *,
        callback_group=None,
        event_callbacks=None,
        qos_overriding_options=None,
        raw=False,
    ):
        group, qos = self._check(msg_type, topic, callback_group, event_callbacks), self._qos(qos_profile)
        _override(self, "subscription", topic, qos, qos_overriding_options)
        return Subscription(self, msg_type, topic, callback, qos, group, raw)

    def create_service(self, srv_type, srv_name, callback, *, qos_profile=None, callback_group=None):
        group = self._check(srv_type, srv_name, callback_group, qos_profile, parts=True)
        return Service(self, srv_type, srv_name, callback, group)

    def create_client(self, srv_type, srv_name, *, qos_profile=None, callback_group=None):
        return Client(
            self, srv_type, srv_name, self._check(srv_type, srv_name, callback_group, qos_profile, parts=True)
        )

    def create_timer(self, timer_period_sec, callback, callback_group=None, clock=None):
        if not (isinstance(clock, Clock) and clock.clock_type is ClockType.STEADY_TIME):
            raise NotImplementedError("the node's own clock stands still with the simulation")
        timer = Timer(timer_period_sec, callback, callback_group or self._group)
        self._executor._timers.append(timer)
        self._executor._wake()
        return timer

    def destroy_publisher(self, publisher):
        return _destroy(publisher, Publisher)

    def destroy_subscription(self, subscription):
        return _destroy(subscription, Subscription)

    def destroy_service(self, service):
        return _destroy(service, Service)

    def destroy_client(self, client):
        return _destroy(client, Client)

    def destroy_timer(self, timer):
        self._executor._timers.remove(timer)
        return True

    def destroy_node(self):
        self._executor._nodes.remove(self)

    def get_topic_names_and_types(self, no_demangle=False):
        return sorted((name, sorted(types)) for name, types in context.topics.items())

    def _check(self, interface, name, callback_group, unused, parts=False):
        if unused is not None:
            raise NotImplementedError
        known = isinstance(interface, type) and (
            hasattr(interface, "Request") if parts else issubclass(interface, Interface)
        )
        if not known:
            raise TypeError(f"{interface!r} is no interface of that kind")
        if not _NAME.fullmatch(name):
            raise InvalidTopicNameException(name)
        if callback_group is not None and not isinstance(callback_group, CallbackGroup):
            raise TypeError(f"{callback_group!r} is no callback group")
        return callback_group or self._group

    def _qos(self, qos_profile):
        if not isinstance(qos_profile, QoSProfile):
            raise TypeError(f"Expected QoSProfile, but received {type(qos_profile)}")
        return qos_profile


def _override(node, entity_type, topic, qos, options):
    qos_overriding_options.declare(node, entity_type, topic, qos, options)


def _destroy(entity, kind):
    if not isinstance(entity, kind):
        raise TypeError(f"{entity!r} is no {kind.__name__}")
    entity._destroy()
    return True


def _kind(value):
    if isinstance(value, list):
        # The elements of an empty list have no type, and rclpy treats it as a list of bytes.
        return f"{_kind(value[0])} array" if value else "byte array"
    kinds = {bool: "bool", int: "integer", float: "double", str: "string"}
    if type(value) not in kinds:
        raise TypeError(f"{value!r} cannot be a parameter")
    return kinds[type(value)]
