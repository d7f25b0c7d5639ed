"""Parameters of plugins that the ROS parameter services can change while the server runs. Physics thread only."""

from collections.abc import Callable, Mapping
from typing import Generic, TypeVar

from pydantic import BaseModel, ValidationError

from mjplug.errors import RequestError

P = TypeVar("P", bound=BaseModel)

Scalar = bool | int | float | str

_TYPES = (bool, int, float, str)


class ParameterGroup(Generic[P]):
    """Parameters that are validated and applied together: the plain fields of a pydantic model.

    Attributes:
        current: The values in effect.

    Args:
        values: The values at the start.
        on_change: Applies new values. It may refuse them with a RequestError, if it has not applied any of them.
    """

    def __init__(self, values: P, on_change: Callable[[P], None]) -> None:
        self.current = values
        self._on_change = on_change

    @property
    def fields(self) -> Mapping[str, str]:
        """The descriptions of the parameters, by name."""
        fields = type(self.current).model_fields
        return {
            name: field.description or ""
            for name, field in fields.items()
            # Not subclasses such as enumerations, which strict validation would not accept as text.
            if type(getattr(self.current, name)) in _TYPES
        }

    def read(self, name: str) -> Scalar:
        """Returns the current value of a parameter."""
        value: Scalar = getattr(self.current, name)
        return value

    def checked(self, name: str, changes: Mapping[str, Scalar | None]) -> P:
        """Returns the values with some of them changed; nothing is applied.

        Args:
            name: The full name of the group, for the error message.
            changes: The new values by the names of the parameters.

        Raises:
            RequestError: The values are not valid, by themselves or together.
        """
        try:
            return type(self.current).model_validate({**self.current.model_dump(), **changes})
        except ValidationError as error:
            messages = [
                f"{'.'.join((name, *map(str, details['loc'])))}: {details['msg'].removeprefix('Value error, ')}"
                for details in error.errors(include_url=False)
            ]
            raise RequestError(f"parameter {'; '.join(messages)}") from None

    def apply(self, values: P) -> None:
        """Puts values into effect.

        Raises:
            RequestError: The owner refuses them.
        """
        self._on_change(values)
        self.current = values


class ChangeableParameters:
    """The parameter groups of all plugins, by the full name of the group, such as `plugins.arm.pid_gains.position.j1`.

    A parameter's full name is that of its group, a dot and its own name.
    """

    def __init__(self) -> None:
        self.groups: dict[str, ParameterGroup[BaseModel]] = {}

    def add(self, name: str, group: ParameterGroup[BaseModel]) -> None:
        """Adds a group, whose name must be new."""
        self.groups[name] = group

    def remove(self, name: str) -> None:
        """Removes a group."""
        self.groups.pop(name, None)

    def change(self, changes: Mapping[str, Mapping[str, Scalar | None]]) -> None:
        """Changes parameters of several groups, all of them or none.

        Args:
            changes: The new values by the names of the group and of the parameter; None is a value that is no scalar.

        Raises:
            RequestError: A value is refused; nothing has changed.
        """
        planned = []
        for name, values in changes.items():
            group = self.groups[name]
            planned.append((name, group, group.current, group.checked(name, values)))
        applied: list[tuple[ParameterGroup[BaseModel], BaseModel]] = []
        for name, group, before, after in planned:
            try:
                group.apply(after)
            except RequestError as error:
                for changed, old in reversed(applied):
                    changed.apply(old)
                raise RequestError(f"parameters {name}: {error}") from None
            applied.append((group, before))
