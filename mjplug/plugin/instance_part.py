"""Saves and restores one plugin instance, or the server itself. Physics thread only."""

import json
import math
import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from mjplug.contracts.parameters import ParameterGroup
from mjplug.errors import RequestError, is_fault
from mjplug.physics.part import SavedPart
from mjplug.physics.scheduler import Timer
from mjplug.physics.steppers import Stepper
from mjplug.physics.velocity import VelocityHold
from mjplug.plugin.guard import Guard

SERVER = "~"
"""Name of the part that is the server itself."""

_ARRAY_NAME = re.compile(r"[A-Za-z0-9_.-]{1,100}")
_KINDS = "biuf"
"""Kinds of NumPy types that an array may have: booleans, integers and floating-point numbers."""


@runtime_checkable
class Saving(Protocol):
    """The part of a plugin that saves and restores its state."""

    stateless: bool

    def save(self) -> Mapping[str, Any] | None:
        """Returns the state; None if the plugin does not save it."""

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Sets the state."""


class InstancePart:
    """Implements `mjplug.physics.part.Part`.

    The server saves what it manages for the instance: whether `update` is called, velocity holds, timers, the random
    numbers of `host.random`, and parameters that clients can change. The plugin saves the rest in `Plugin.save`.

    Attributes:
        name: The instance's name; `SERVER` for the server itself.
        groups: The changeable parameters of the instance, by the name of the group.

    Args:
        guard: The guard of the instance.
        generator: Returns the random number generator of the instance.
        entropy: What the random numbers depend on, with the number of resets.
    """

    def __init__(self, guard: Guard, generator: Callable[[], np.random.Generator], entropy: Sequence[int]) -> None:
        self.name = SERVER
        self.groups: dict[str, ParameterGroup[Any]] = {}
        self._guard = guard
        self._generator = generator
        self._entropy = entropy
        self._plugin: Saving | None = None

    def attach(self, name: str, plugin: object) -> None:
        """Sets the plugin whose state is saved; an object without the methods for it has none."""
        self.name = name
        self._plugin = plugin if isinstance(plugin, Saving) else None

    @property
    def timers(self) -> Mapping[int, Timer]:
        """The timers that were not cancelled, by their number in the order of creation."""
        return self._guard.timers

    @property
    def stepper(self) -> Stepper | None:
        """The stepper of the plugin; None for the server itself."""
        return self._guard.stepper

    @property
    def holds(self) -> Sequence[VelocityHold]:
        """The velocity holds in the order of creation."""
        return self._guard.holds

    def reset(self, lineage: int) -> None:
        """Starts `host.random` anew; its numbers then depend on seed, instance and `lineage` only."""
        bits = self._generator().bit_generator
        bits.state = type(bits)(np.random.SeedSequence(self._entropy, spawn_key=(lineage,))).state

    def save(self) -> SavedPart:
        """Returns a copy of the state."""
        values: dict[str, Any] = {
            "random": self._generator().bit_generator.state,
            "parameters": {
                name: {field: group.read(field) for field in group.fields} for name, group in self.groups.items()
            },
            "active": self._guard.active,
            "holds": [hold.velocities for hold in self.holds],
            "plugin": self._kind,
        }
        arrays: dict[str, NDArray[Any]] = {}
        try:
            values["saved"], arrays = self._save_plugin()
            # Copies, and refuses a generator whose state is no JSON.
            values = json.loads(json.dumps(values))
        except (TypeError, ValueError, RecursionError) as error:
            return SavedPart({"plugin": self._kind}, {}, f"its state cannot be stored: {error}")
        except RequestError as error:
            return SavedPart({"plugin": self._kind}, {}, str(error))
        return SavedPart(values, arrays)

    def check(self, saved: SavedPart) -> str:
        """Returns why a state cannot be restored; empty if the plugin decides."""
        if saved.left_out:
            return saved.left_out
        values = saved.values
        if values.get("plugin") != self._kind:
            return f"it is of type {self._kind} now, not {values.get('plugin')}"
        if self._guard.disabled:
            return self._guard.disabled
        try:
            # On another generator, so that nothing changes.
            type(self._generator().bit_generator)().state = values["random"]
            for hold, velocities in zip(self.holds, values["holds"], strict=True):
                if velocities and not (len(velocities) == len(hold.dofs) and all(map(math.isfinite, velocities))):
                    return "its velocity holds are different now"
            for name, group in self._saved_groups(values):
                group.checked(name, values["parameters"][name])
            if not isinstance(json.loads(values["saved"]), dict) or not isinstance(values["active"], bool):
                return "its saved state is invalid"
        except RequestError as error:
            return str(error)
        except (ArithmeticError, LookupError, TypeError, ValueError, RecursionError) as error:
            return f"its saved state is invalid: {error!r}"
        return ""

    def restore(self, saved: SavedPart, trial: bool = False) -> str:
        """Restores a state that `check` has accepted; returns why it could not be restored, or an empty text."""
        values = saved.values
        plugin = self._plugin
        if trial and plugin is not None and plugin.stateless:
            # It would be reset, and cannot be set back.
            plugin = None
        try:
            for name, group in self._saved_groups(values):
                changed = group.checked(name, values["parameters"][name])
                if changed != group.current:
                    group.apply(changed)
            if plugin is not None:
                arrays = {name: array.copy() for name, array in saved.arrays.items()}
                plugin.restore({**json.loads(values["saved"]), **arrays})
        except RequestError as error:
            return str(error)
        except BaseException as error:
            if not is_fault(error):
                raise
            return f"its saved state is invalid: {error!r}"
        self._generator().bit_generator.state = values["random"]
        for hold, velocities in zip(self.holds, values["holds"], strict=True):
            hold.release()
            if velocities:
                hold.set(*velocities)
        if values["active"]:
            self._guard.activate()
        else:
            self._guard.deactivate()
        return ""

    @property
    def _kind(self) -> str:
        return type(self._plugin).__qualname__ if self._plugin is not None else ""

    def _saved_groups(self, values: Mapping[str, Any]) -> list[tuple[str, ParameterGroup[Any]]]:
        return [(name, group) for name, group in self.groups.items() if name in values["parameters"]]

    def _save_plugin(self) -> tuple[str, dict[str, NDArray[Any]]]:
        """Returns what the plugin saves: JSON text of its values, and copies of its arrays by name.

        Raises:
            RequestError: The plugin saves nothing, or failed.
        """
        if self._guard.disabled:
            raise RequestError(self._guard.disabled)
        if self._plugin is None or self._plugin.stateless:
            return "{}", {}
        try:
            saved = self._plugin.save()
        except RequestError:
            raise
        except BaseException as error:
            if not is_fault(error):
                raise
            self._guard.report("save failed", error)
            raise RequestError(f"its method save failed: {error!r}") from error
        if saved is None:
            raise RequestError("the plugin does not save its state")
        arrays = {name: value.copy() for name, value in saved.items() if isinstance(value, np.ndarray)}
        for name, array in arrays.items():
            if not (_ARRAY_NAME.fullmatch(name) and array.dtype.kind in _KINDS):
                raise RequestError(f"it saves an array {name!r} of {array.dtype}; names are letters, digits and _.-")
        return json.dumps({name: value for name, value in saved.items() if name not in arrays}), arrays
