from rclpy import _cdr
from rclpy._interfaces import Interface


def serialize_message(message):
    if not isinstance(message, Interface):
        raise TypeError(f"{message!r} is no message")
    return _cdr.serialize(message)


def deserialize_message(serialized_message, message_type):
    if type(serialized_message) is not bytes:
        raise TypeError(f"a buffer of {type(serialized_message)} is not accepted by all versions; use bytes")
    if not (isinstance(message_type, type) and issubclass(message_type, Interface)):
        raise TypeError(f"{message_type!r} is no message type")
    return _cdr.deserialize(serialized_message, message_type)
