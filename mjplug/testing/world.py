"""A simulation with plugins that a test steps, without a network and without threads."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any, Literal, TypeVar

import mujoco

from mjplug import __version__
from mjplug.contracts.diagnostics import Diagnostics
from mjplug.contracts.topics import Topics
from mjplug.convert.load import load_model
from mjplug.physics.loop import Loop
from mjplug.physics.reset import Reset
from mjplug.physics.simulation import Simulation
from mjplug.plugin import Host, Plugin
from mjplug.plugin.stopwatch import Stopwatch
from mjplug.server.local_calls import LocalCall
from mjplug.services.states.keeper import Keeper
from mjplug.services.states.saved_state import SavedState
from mjplug.testing.goals import FakeGoal
from mjplug.testing.transport import FakeTransport
from mjplug.testing.workers import InlineWorkerPool
from mjplug_schemas.action_msgs import CancelGoal, GoalInfo
from mjplug_schemas.message import Message
from mjplug_schemas.names import resolve
from mjplug_schemas.unique_identifier_msgs import UUID

P = TypeVar("P", bound=Plugin[Any])


class World:
    """A simulation with plugins, whose topics and services a test uses without a network.

    The loop, the hosts and the physics are those of the server. Time advances in `step` only. Every topic has a
    subscriber until a test changes that: `world.transport.publishers["/lamp/height"].matched = False`.

    Attributes:
        transport: The topics and services.
        workers: The workers that plugins have created, by the name of the instance.
        diagnostics: The diagnostics of the plugins.
        topics: The topics of the plugins, as step requests use them.
        simulation: The model and its state, as the loop sees them.
        loop: The physics loop.

    Args:
        model: A compiled model, MJCF text that begins with `<`, or any value of `model:` in a configuration file, such
            as `bundled:arm`.
        keyframe: Name or index of the keyframe to start from; empty means the model's default pose.
        paused: Whether the simulation is paused; `step` takes steps even then.
        speed: Real-time factor; only `loop.run` uses it.
        on_divergence: As `sim.on_divergence` in a configuration file.

    Raises:
        ModelError: The model cannot be loaded.
        UnknownName: There is no such keyframe.
    """

    def __init__(
        self,
        model: mujoco.MjModel | str | Path = "bundled:box",
        keyframe: str = "",
        paused: bool = False,
        speed: float | Literal["max"] = "max",
        on_divergence: Literal["pause", "reset", "stop"] = "pause",
    ) -> None:
        self.simulation = Simulation(_compiled(model), keyframe)
        self.loop = Loop(self.simulation, speed, paused, on_divergence)
        self.transport = FakeTransport()
        self.workers = InlineWorkerPool()
        self.diagnostics = Diagnostics()
        self.topics = Topics()

    @property
    def model(self) -> mujoco.MjModel:
        """The compiled model."""
        return self.simulation.model

    @property
    def data(self) -> mujoco.MjData:
        """The state. Between two steps, it may be read and written."""
        return self.simulation.data

    @property
    def time_ns(self) -> int:
        """Simulated time since the start [ns]."""
        return self.simulation.time_ns

    def host(
        self,
        name: str = "test",
        *,
        seed: int = 0,
        disable_on_error: bool = False,
        model_file: Path | None = None,
        folders: Sequence[Path] = (),
        stopwatch: Stopwatch | None = None,
        frame_prefix: str = "",
    ) -> Host:
        """Returns the host of a new plugin instance.

        Args:
            name: The instance's name; its relative topics are below `/<name>/`.
            seed: Seed of the host's random numbers.
            disable_on_error: Whether a failure disables the plugin, as `on_plugin_error: disable` does.
            model_file: The file of the model; None if it has none.
            folders: Folders for relative paths in the plugin's parameters.
            stopwatch: Measures the wall time of the plugin's calls; None means that no test reads it.
            frame_prefix: Prefix of TF frames.
        """
        names = partial(resolve, namespace="", node=name, remap={})
        return Host(
            name,
            self.loop,
            self.transport,
            names,
            self.workers,
            self.diagnostics,
            seed,
            disable_on_error,
            model_file,
            folders,
            stopwatch,
            frame_prefix,
            topics=self.topics,
        )

    def add(self, plugin_class: type[P], name: str = "test", **parameters: Any) -> P:
        """Starts a plugin instance.

        Args:
            plugin_class: The plugin's class.
            name: The instance's name; its relative topics are below `/<name>/`.
            **parameters: Its parameters.

        Returns:
            The plugin.

        Raises:
            Exception: Any error of the plugin's `init`.
        """
        plugin = plugin_class()
        host = self.host(name)
        validated = plugin_class.parameters_type(**parameters)
        host.attach(plugin, validated)
        plugin.init(host, validated)
        return plugin

    def step(self, steps: int = 1) -> None:
        """Takes steps. Waiting messages and requests, timers and updates are handled as in the server.

        Args:
            steps: Number of steps; 0 handles only the waiting messages and requests.

        Raises:
            PluginError: A plugin failed.
            MjplugError: The simulation diverged, and `on_divergence` is `stop`.
        """
        self.loop.step(steps)
        if self.loop.failure is not None:
            raise self.loop.failure

    def reset(self) -> None:
        """Resets the world, as a request to `~/reset_world` does."""
        self.loop.reset(Reset())

    def save(self) -> SavedState:
        """Returns the state of the simulation and its plugins, as a request to `~/save_state` saves it."""
        return self._keeper().save()

    def restore(self, state: SavedState) -> None:
        """Restores a state of `save`, as a request to `~/restore_state` with `strict` does.

        Args:
            state: The state, also of another world with the same model and plugins.

        Raises:
            RequestError: The state does not fit, or a plugin does not save or restore its state.
        """
        self._keeper().restore(state, strict=True)

    def _keeper(self) -> Keeper:
        return Keeper(self.loop, 0, __version__)

    def call(self, name: str, request: Message | None = None, **parameters: str) -> LocalCall:
        """Sends a request to a service, which handles it at once, without a step.

        Args:
            name: The service's full name, such as `/lamp/set_zero`.
            request: The request; None means a request with default values.
            **parameters: Parameters of the selector, such as `wait="false"`.

        Returns:
            The call. A service that takes simulated time answers in a later `step`.
        """
        call = self.transport.call(name, request, **parameters)
        self.loop.step(0)
        return call

    def send_goal(self, name: str, goal: Message | None = None, **parameters: str) -> FakeGoal:
        """Sends a goal to an action, which handles it at once, without a step.

        Args:
            name: The action's full name, such as `/lamp/move`.
            goal: The goal; None means a goal with default values.
            **parameters: Parameters of the selector, such as `goal_id`.

        Returns:
            The goal. It gets feedback and its result in later calls of `step`.
        """
        sent = self.transport.send_goal(name, goal, **parameters)
        self.loop.step(0)
        return sent

    def cancel_goal(self, name: str, goal: FakeGoal) -> LocalCall:
        """Cancels a goal, which is handled at once, without a step.

        Args:
            name: The action's full name.
            goal: The goal.

        Returns:
            The call of the service `cancel_goal` with its response.
        """
        info = GoalInfo(goal_id=UUID(uuid=goal.id))
        return self.call(f"{name}/_action/cancel_goal", CancelGoal.Request(goal_info=info))

    def publish(self, name: str, message: Message) -> None:
        """Sends a message to the plugins that subscribe to a topic. They handle it at once, without a step.

        Args:
            name: The topic's full name, such as `/cmd_vel`.
            message: The message.
        """
        self.transport.send(name, message)
        self.loop.step(0)

    def published(self, name: str) -> list[Any]:
        """Returns the messages that plugins have published on a topic, oldest first. A test may clear the list.

        Args:
            name: The topic's full name, such as `/lamp/height`.
        """
        return self.transport.publishers[name].messages


def _compiled(model: mujoco.MjModel | str | Path) -> mujoco.MjModel:
    if isinstance(model, mujoco.MjModel):
        return model
    if isinstance(model, str) and model.lstrip().startswith("<"):
        return mujoco.MjModel.from_xml_string(model)
    return load_model(str(model)).model
