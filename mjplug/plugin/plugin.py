"""What a plugin is: a class with typed parameters and four calls, all made on the physics thread."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, ClassVar, Generic, TypeVar, get_args, get_origin

from pydantic import BaseModel, BeforeValidator, ConfigDict
from pydantic_core import PydanticKnownError

if TYPE_CHECKING:
    from mjplug.plugin.host import Host


class Parameters(BaseModel):
    """Base of a plugin's parameters: frozen, strict, and refusing names it does not know.

    Every field should have a description with its unit; `mjplug plugin info` shows them.
    """

    model_config = ConfigDict(
        frozen=True, extra="forbid", strict=True, use_attribute_docstrings=True, allow_inf_nan=False
    )


def _nested(value: object) -> object:
    if isinstance(value, bool | int | float | str):
        raise PydanticKnownError("extra_forbidden")
    return {} if value is None else value


NestedParameters = BeforeValidator(_nested)
"""Marks parameters below names that users choose: `__pydantic_extra__: dict[str, Annotated[Lidar, NestedParameters]]`.

A plain value there is refused as a misspelt parameter; an empty section gets the defaults.
"""

P = TypeVar("P", bound=Parameters)


def _parameters_of(cls: type) -> object:
    """Returns the type argument that a plugin class gives to `Plugin`, through generic classes between the two.

    It is a TypeVar where the class leaves it open, and None where the class is no subclass of a generic one.
    """
    for base in cls.__dict__.get("__orig_bases__", cls.__bases__):
        origin = get_origin(base) or base
        if origin is Plugin:
            return next(iter(get_args(base)), None)
        if isinstance(origin, type) and issubclass(origin, Plugin):
            argument = _parameters_of(origin)
            # The variables of a generic class stand in the order of the arguments that it gets.
            variables = getattr(origin, "__parameters__", ())
            return get_args(base)[variables.index(argument)] if get_args(base) and argument in variables else argument
    return None


class Plugin(ABC, Generic[P]):
    """Base of every plugin; its type argument is its parameter model: `class Heartbeat(Plugin[HeartbeatParameters])`.

    The calls come in this order, once each unless said otherwise: `init`; then `update` before every step while the
    plugin is active (`host.activate()`), and `on_reset` after every reset of the world; at the end `cleanup`, also
    after an `init` that failed. They are all made on the physics thread, so a plugin needs no locks, and must not
    block.
    """

    parameters_type: ClassVar[type[Parameters]] = Parameters

    def __init_subclass__(cls, **kwargs: object) -> None:
        super().__init_subclass__(**kwargs)
        argument = _parameters_of(cls)
        if isinstance(argument, TypeVar):
            # A generic base that was subclassed without an argument, or not yet: its bound is what its code may use.
            argument = argument.__bound__
        if isinstance(argument, type) and issubclass(argument, Parameters):
            cls.parameters_type = argument
        elif argument is not None:
            raise TypeError(
                f"the parameters of plugin {cls.__name__} are {argument!r}; "
                "they must be a subclass of Parameters that is defined before the plugin"
            )

    @abstractmethod
    def init(self, host: Host, parameters: P) -> None:
        """Looks names up once and creates publishers, subscriptions, services and timers.

        Args:
            host: What the plugin may use of the server; keep it.
            parameters: The validated parameters of this instance.

        Raises:
            MjplugError: To refuse; the server then does not start, and the sentence is shown to the user.
        """

    def update(self) -> None:
        """Runs before every step while the plugin is active.

        `data.xfrc_applied` and `data.qfrc_applied` are zero before the first plugin's update: add to them. Body poses
        are those of the previous step until `host.kinematics()` is called.
        """

    def on_reset(self) -> None:
        """Runs after the world was reset, and waiting requests were closed: forget what belonged to the past."""

    def cleanup(self) -> None:
        """Releases what `init` took, beyond what was created through the host."""
