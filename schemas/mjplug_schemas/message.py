"""The base classes of every message and every service."""

from typing import Any, ClassVar, Self

from pydantic import BaseModel, ConfigDict, ValidationError

from mjplug_schemas import cdr, explain, shape
from mjplug_schemas.errors import DefinitionError


class Message(BaseModel):
    """A ROS 2 message: a frozen record of fields in their order on the wire, each with ROS's initial value.

    The ROS package is the name of the module that holds the class; a class elsewhere names it:
    `class Grip(Message, package="my_msgs")`. Every field needs a default. Constants are class variables, as in
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

    def __init_subclass__(cls, package: str | None = None, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        cls.TYPE = f"{package or _package(cls)}/msg/{cls.__name__}"

    @classmethod
    def __pydantic_init_subclass__(cls, **kwargs: Any) -> None:
        super().__pydantic_init_subclass__(**kwargs)
        shape.check(cls)

    def to_cdr(self) -> bytes:
        """Returns the message in CDR, little endian, with its 4-byte header.

        Raises:
            CodecError: If a value that skipped validation (`model_construct`) does not fit its ROS type.
        """
        return cdr.encode(self)

    @classmethod
    def from_cdr(cls, buffer: bytes | bytearray | memoryview) -> Self:
        """Returns the message that CDR bytes of either byte order hold.

        Raises:
            CodecError: If the bytes are anything else; the sentence names the field and its offset.
        """
        return cdr.decode(cls, buffer)

    def to_json(self) -> bytes:
        """Returns the message as JSON in UTF-8; NaN and infinities are texts, `"NaN"`, `"Infinity"`, `"-Infinity"`."""
        return self.__pydantic_serializer__.to_json(self)

    @classmethod
    def from_json(cls, buffer: bytes | bytearray | memoryview | str) -> Self:
        """Returns the message that JSON text holds; fields left out have their initial values.

        Raises:
            CodecError: If the text is anything else; the sentence names the field, its value and what is allowed.
        """
        try:
            return cls.model_validate_json(bytes(buffer) if isinstance(buffer, memoryview) else buffer)
        except ValidationError as error:
            raise explain.json_error(cls, error) from None


class Service:
    """A ROS 2 service: a name for two messages, written as nested classes `Request` and `Response`.

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
