"""The base classes of messages and services."""

from typing import Any, ClassVar, Self

from pydantic import BaseModel, ConfigDict, ValidationError

from mjplug_schemas import cdr, explain, shape
from mjplug_schemas.errors import DefinitionError


class Message(BaseModel):
    """A ROS 2 message: an immutable record with fields in wire order, each with ROS's default value.

    The ROS package is the name of the module that contains the class, unless the class sets it:
    `class Grip(Message, package="my_msgs")`. The name of the type is that of the class, unless the class sets it with
    `name`, because a service has the same name. Every field needs a default value. Constants are class variables, as in
    `OPEN: ClassVar[uint8] = 1`.

    Attributes:
        TYPE: The ROS type name, such as `std_msgs/msg/String`.
    """

    model_config = ConfigDict(
        frozen=True,
        extra="forbid",
        protected_namespaces=(),
        ser_json_inf_nan="strings",
    )

    TYPE: ClassVar[str] = ""

    def __init_subclass__(cls, package: str | None = None, name: str | None = None, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        cls.TYPE = f"{package or _package(cls)}/msg/{name or cls.__name__}"

    @classmethod
    def __pydantic_init_subclass__(cls, **kwargs: Any) -> None:
        super().__pydantic_init_subclass__(**kwargs)
        shape.check(cls)

    @classmethod
    def unchecked(cls, **values: Any) -> Self:
        """Returns a message without validation, in a tenth of the time of `model_construct`.

        Args:
            **values: All fields, with valid values. Sequences of numbers may be memoryviews of numbers of their type;
                such a message can be encoded in CDR, but not in JSON.
        """
        return cdr.unchecked(cls, values)

    def to_cdr(self) -> bytes:
        """Returns the message in little-endian CDR, including the 4-byte header.

        Raises:
            CodecError: A value that was not validated (`model_construct`) does not fit its ROS type.
        """
        return cdr.encode(self)

    @classmethod
    def from_cdr(cls, buffer: bytes | bytearray | memoryview, *, packed: bool = False) -> Self:
        """Returns the message that is encoded in CDR bytes of either byte order.

        Args:
            buffer: The bytes.
            packed: Whether sequences of numbers are read-only memoryviews of the bytes instead of tuples. Such a
                message can be encoded in CDR again, but not in JSON.

        Raises:
            CodecError: The bytes are not a valid message; the text names the field and its offset.
        """
        return cdr.decode(cls, buffer, packed)

    def to_json(self) -> bytes:
        """Returns the message as UTF-8 JSON; NaN and infinities are the texts `"NaN"`, `"Infinity"`, `"-Infinity"`."""
        return self.__pydantic_serializer__.to_json(self)

    @classmethod
    def from_json(cls, buffer: bytes | bytearray | memoryview | str) -> Self:
        """Returns the message that is encoded in JSON; missing fields have their default values.

        Raises:
            CodecError: The JSON is not a valid message; the text names the field, its value and the allowed values.
        """
        try:
            return cls.model_validate_json(bytes(buffer) if isinstance(buffer, memoryview) else buffer)
        except ValidationError as error:
            raise explain.json_error(cls, error) from None


class Service:
    """A ROS 2 service with two messages, the nested classes `Request` and `Response`.

    Attributes:
        TYPE: The ROS type name, such as `std_srvs/srv/Trigger`; the messages are `…_Request` and `…_Response`.
    """

    TYPE: ClassVar[str] = ""
    Request: ClassVar[type[Message]]
    Response: ClassVar[type[Message]]

    def __init_subclass__(cls, package: str | None = None, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        cls.TYPE = f"{package or _package(cls)}/srv/{cls.__name__}"
        for part in ("Request", "Response"):
            message = vars(cls).get(part)
            if not (isinstance(message, type) and issubclass(message, Message)):
                raise DefinitionError(f"{cls.TYPE} needs a nested class `{part}` that is a Message")
            message.TYPE = f"{cls.TYPE}_{part}"


def _package(cls: type) -> str:
    return cls.__module__.rpartition(".")[2]
