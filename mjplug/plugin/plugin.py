"""The base classes of plugins and their parameters."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, ClassVar, Generic, TypeVar, get_args, get_origin

from mjplug.plugin.parameters import Parameters

if TYPE_CHECKING:
    from mjplug.physics.model_change import ModelChange
    from mjplug.plugin.host import Host


P = TypeVar("P", bound=Parameters)


def _parameters_of(cls: type) -> object:
    """Returns the type argument that a plugin class passes to `Plugin`, directly or through generic base classes.

    Returns a TypeVar if the class does not fix the argument, and None if no base class is generic.
    """
    for base in cls.__dict__.get("__orig_bases__", cls.__bases__):
        origin = get_origin(base) or base
        if origin is Plugin:
            return next(iter(get_args(base)), None)
        if isinstance(origin, type) and issubclass(origin, Plugin):
            argument = _parameters_of(origin)
            # The type variables of a generic class have the same order as its arguments.
            variables = getattr(origin, "__parameters__", ())
            return get_args(base)[variables.index(argument)] if get_args(base) and argument in variables else argument
    return None


class Plugin(ABC, Generic[P]):
    """Base class of every plugin. The type argument is its parameter class: `class Heartbeat(Plugin[Parameters])`.

    The server calls `init` once, then `update` before every step while the plugin is active (`host.activate()`) and
    `on_reset` after every reset of the world, and at the end `cleanup` once, also if `init` failed. All calls are made
    on the physics thread, so a plugin needs no locks and must not block.

    Attributes:
        parameters_type: The parameter class.
        stateless: Whether nothing in the plugin has to be saved with the state of the simulation, apart from what the
            server saves for each instance; see `save`.
    """

    stateless: ClassVar[bool] = False
    parameters_type: ClassVar[type[Parameters]] = Parameters

    def __init_subclass__(cls, **kwargs: object) -> None:
        super().__init_subclass__(**kwargs)
        if cls.save is not Plugin.save and cls.restore is Plugin.restore:
            raise TypeError(f"plugin {cls.__name__} has the method save; add the method restore")
        argument = _parameters_of(cls)
        if isinstance(argument, TypeVar):
            # The class is generic, or its generic base got no argument; its code may then use the variable's bound.
            argument = argument.__bound__
        if isinstance(argument, type) and issubclass(argument, Parameters):
            cls.parameters_type = argument
        elif argument is not None:
            raise TypeError(
                f"the type argument of plugin {cls.__name__} is {argument!r}; "
                "it must be a subclass of Parameters that is defined before the plugin"
            )

    @abstractmethod
    def init(self, host: Host, parameters: P) -> None:
        """Looks up names and creates publishers, subscriptions, services and timers.

        Args:
            host: The plugin's interface to the server; keep a reference to it.
            parameters: The validated parameters of this instance.

        Raises:
            MjplugError: Raise it to refuse the configuration; the server then does not start and shows the text.
        """

    def update(self) -> None:
        """Runs before every step while the plugin is active.

        `data.xfrc_applied` and `data.qfrc_applied` are zero before the first plugin's update; add forces to them. Body
        poses are those of the previous step until `host.kinematics()` is called.
        """

    def on_reset(self) -> None:
        """Runs after the world was reset and waiting requests were refused. Discard data about the old state here."""

    def on_model_changed(self, change: ModelChange) -> None:
        """Runs after the model has changed, because an entity was added or removed. Ids and arrays are others now.

        The default calls `change.restart()`: `cleanup`, then `init`, where names become ids, then `restore` with what
        `save` has returned before. Topics, services and timers that `init` creates again are the same as before, for
        clients too. Waiting requests of the plugin are refused. If `init` raises an error, for example because its
        robot was removed, the instance is disabled until the next change.

        Args:
            change: What has changed, with the new id of each old element.
        """
        change.restart()

    def save(self) -> Mapping[str, Any] | None:
        """Returns the plugin's part of a saved state: all data that later calls depend on.

        The server saves MuJoCo's state, timers, velocity holds, whether the plugin is active, `host.random`, and
        parameters that clients can change. A plugin for which this is enough sets `stateless = True` instead of this
        method.

        Save step numbers and times relative to `host.step` and `host.time_ns`, because both may differ after a restore.

        Returns:
            JSON values and NumPy arrays of numbers, by name; None if the state cannot be saved. The server then lists
            the plugin as left out of the saved state.
        """
        return None

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Sets what `save` has returned; called instead of `on_reset`, after the state of the simulation was restored.

        The default calls `on_reset`.

        Args:
            saved: Equal to what `save` has returned. It may come from a file, so check it before anything changes.

        Raises:
            RequestError: It does not fit this plugin. The server then calls `on_reset`, or refuses the whole restore.
        """
        self.on_reset()

    def cleanup(self) -> None:
        """Releases resources that `init` acquired. Everything created through the host is released automatically."""
