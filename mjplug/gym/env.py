"""An environment whose physics is a server: in this process, or anywhere on the network."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from typing import Any, cast

import gymnasium
import numpy as np
from numpy.typing import NDArray

from mjplug import RunningServer, open_server
from mjplug.client import Client
from mjplug.client.driver import DEFAULT_OBSERVE, StepResult
from mjplug.errors import MjplugError
from mjplug.server.local_client import LocalClient

Array = NDArray[np.float64]

Start = Mapping[str, Any]
"""Fields of a request to `~/reset_world`: `keyframe` and `state_overrides`."""


class MjplugEnv(gymnasium.Env[Array, Array]):
    """A gymnasium environment that steps a server.

    The action is the vector of controls, unless a subclass converts it. The observation contains arrays of mjData, one
    after the other. Reward, termination and the random start are functions of yours, or methods of a subclass.

    Args:
        server: What a server is opened from, as for `mjplug.open_server`: it runs in this process, on the thread that
            creates the environment, and is stopped by `close`. Or a `RunningServer`, or a `Client`, which stay open.
        reward: Returns the reward of an observation and the action that led to it; None means 0.
        terminated: Returns whether the episode ends with an observation; None means never.
        start: Returns the fields of a request to `~/reset_world`, such as
            `{"state_overrides": {"joint_states": {"name": ["hinge"], "position": [0.1]}}}`. All random numbers must be
            drawn from the generator that it gets, so that a seed always gives the same start.
        observe: Arrays of mjData in the observation.
        outputs: Topics whose newest messages `observation_of` reads, such as those of noisy sensors.
        steps: Number of physics steps for each action.
        action_space: The controls; None reads their limits from the model. Required with a `Client` if the policy
            needs limits, because a client does not have the model.
        render_mode: `rgb_array` or None.
        camera: Topic of the colour images for `rgb_array`. The camera needs `sync: true`.
        **options: Options of `mjplug.open_server`, such as `plugins`, if the environment opens the server.

    Attributes:
        model: The compiled model, to be read only; None with a `Client`.
    """

    # gymnasium declares it as a variable of instances.
    metadata: dict[str, Any] = {"render_modes": ["rgb_array"]}  # noqa: RUF012

    def __init__(
        self,
        server: Any,
        *,
        reward: Callable[[Array, Array], float] | None = None,
        terminated: Callable[[Array], bool] | None = None,
        start: Callable[[np.random.Generator], Start] | None = None,
        observe: Sequence[str] = DEFAULT_OBSERVE,
        outputs: Sequence[str] = (),
        steps: int = 1,
        action_space: gymnasium.Space[Array] | None = None,
        render_mode: str | None = None,
        camera: str = "",
        **options: Any,
    ) -> None:
        if render_mode not in (None, "rgb_array"):
            raise MjplugError(f"render_mode is {render_mode!r}; it must be 'rgb_array' or None")
        if render_mode and not camera:
            raise MjplugError("render_mode 'rgb_array' needs camera, the topic of the colour images")
        self.render_mode = render_mode
        self._camera = camera
        self._reward, self._terminated, self._start = reward, terminated, start
        self._observe, self._outputs, self._steps, self._first = tuple(observe), tuple(outputs), steps, 0
        self._closing = ExitStack()
        try:
            self._driver, self.model = self._connect(server, options)
            self._driver.call("~/set_pause", paused=True)
            names = list(dict.fromkeys((*self._observe, "ctrl")))
            first = self._driver.step(0, observe=names, outputs=self._outputs)
            self.action_space = action_space or _controls(self.model, first["ctrl"].size)
            size = self.observation_of(first).size
            space: Any = gymnasium.spaces.Box(-np.inf, np.inf, (size,), np.float64)
            self.observation_space = space
        except BaseException:
            self._closing.close()
            raise

    @property
    def driver(self) -> Any:
        """The client that steps the server: a `Client` or a `LocalClient`."""
        return self._driver

    def observation_of(self, result: StepResult) -> Array:
        """Returns the observation: the arrays of `observe`, one after the other.

        Args:
            result: The arrays of `observe`; `result.message(topic)` returns the message of a topic in `outputs`.
        """
        return np.concatenate([result[name].reshape(-1) for name in self._observe])

    def controls_of(self, action: Array) -> Array:
        """Returns the controls for an action: the action itself."""
        return action

    def reward_of(self, observation: Array, action: Array) -> float:
        """Returns the reward of an observation and the action that led to it."""
        return float(self._reward(observation, action)) if self._reward is not None else 0.0

    def is_terminated(self, observation: Array) -> bool:
        """Returns whether the episode ends with an observation."""
        return bool(self._terminated(observation)) if self._terminated is not None else False

    def draw_start(self, random: np.random.Generator) -> Start:
        """Returns the fields of a request to `~/reset_world` for the next episode."""
        return self._start(random) if self._start is not None else {}

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Array, dict[str, Any]]:
        """Resets the world and returns the first observation. Simulated time begins at 0, or at that of a saved state.

        Args:
            seed: Seed of the random numbers of `start`, and of noise. An episode depends on it and on its actions
                only, bit by bit, not on earlier episodes.
            options: `keyframe` replaces the keyframe of `start`. With `state`, the saved state of this name is
                restored instead of a reset, and `start` is not called.

        Raises:
            RequestRefused: The server refuses the start.
        """
        super().reset(seed=seed)
        options = options or {}
        if unknown := options.keys() - {"keyframe", "state"}:
            raise MjplugError(f"unknown options: {', '.join(sorted(unknown))}; known: keyframe, state")
        if len(options) > 1:
            raise MjplugError("give either keyframe or state, not both")
        # The number, and not the seed, goes to the server, so that each episode of a seed has noise of its own.
        episode = int(self.np_random.integers(2**62))
        if "state" in options:
            self._driver.restore(options["state"], episode=episode)
        else:
            self._driver.reset(**{**self.draw_start(self.np_random), **options}, episode=episode)
        result = self._driver.step(0, observe=self._observe, outputs=self._outputs)
        self._first = result.step
        return self.observation_of(result), self._info(result)

    def step(self, action: Array) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Takes `steps` physics steps with an action.

        Returns:
            Observation, reward, whether the episode has ended, false (a time limit is that of the wrapper TimeLimit),
            and a dictionary with `steps`, the number of physics steps since the reset.

        Raises:
            RequestRefused: The simulation has diverged, or another client controls the server.
        """
        result = self._driver.step(
            self._steps, ctrl=self.controls_of(action), observe=self._observe, outputs=self._outputs
        )
        observation = self.observation_of(result)
        reward, terminated = self.reward_of(observation, action), self.is_terminated(observation)
        return observation, reward, terminated, False, self._info(result)

    def render(self) -> Any:
        """Returns an image of the present state, shape (height, width, 3), uint8; None without `render_mode`."""
        if self.render_mode is None:
            return None
        image = self._driver.step(0, observe=(), outputs=[self._camera]).message(self._camera)
        if image is None or image.encoding != "rgb8":
            raise MjplugError(f"{self._camera} has no rgb8 image")
        return np.frombuffer(image.data, np.uint8).reshape(image.height, image.width, 3).copy()

    def close(self) -> None:
        """Stops the server if the environment has opened it; a second call does nothing."""
        self._closing.close()

    def _info(self, result: StepResult) -> dict[str, Any]:
        return {"steps": result.step - self._first}

    def _connect(self, server: Any, options: dict[str, Any]) -> tuple[Any, Any]:
        """Returns the client that steps the server, and the model if it is available in this process."""
        if isinstance(server, Client | RunningServer | LocalClient):
            if options:
                raise MjplugError(f"{', '.join(sorted(options))}: the server is open already; its options are fixed")
            driver = server.local if isinstance(server, RunningServer) else server
            self._closing.callback(driver.release)
            return driver, driver.model if isinstance(driver, LocalClient) else None
        opened = self._closing.enter_context(open_server(server, run=False, **{"environ": {}, **options}))
        return opened.local, opened.local.model


def unit_box(size: int) -> gymnasium.Space[Array]:
    """Returns the space of vectors whose elements are from -1 to 1."""
    space: Any = gymnasium.spaces.Box(-1.0, 1.0, (size,), np.float64)
    return cast("gymnasium.Space[Array]", space)


def _controls(model: Any, nu: int) -> gymnasium.Space[Array]:
    """Returns the space of the controls: their limits in the model; infinite if there is no limit or no model."""
    low, high = np.full(nu, -np.inf), np.full(nu, np.inf)
    if model is not None:
        limited = np.asarray(model.actuator_ctrllimited, bool)
        low[limited], high[limited] = model.actuator_ctrlrange[limited].T
    space: Any = gymnasium.spaces.Box(low, high, (nu,), np.float64)
    return cast("gymnasium.Space[Array]", space)
