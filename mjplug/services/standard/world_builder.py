"""Changes the model while the simulation runs: compiled in a thread, and put into use between two steps."""

import threading
from collections.abc import Callable, Generator, Mapping
from queue import SimpleQueue
from typing import Any, Generic, TypeVar

import mujoco
import numpy as np

from mjplug.contracts.work import WorkerPool
from mjplug.log_scope import bound
from mjplug.model.recipe import Composition, Recipe, Source, compose, maps_between
from mjplug.physics.fitted import Fitted
from mjplug.physics.loop import Loop
from mjplug.physics.model_change import ModelChange, Replacement
from mjplug.physics.model_digest import model_digest
from mjplug.physics.scheduler import Event, Wait
from mjplug.physics.transfer import Transfer

T = TypeVar("T")

_STATE = int(mujoco.mjtState.mjSTATE_INTEGRATION)


class Task(Generic[T]):
    """A function that the builder thread calls.

    Attributes:
        ended: Set on the physics thread when the function has ended.
        result: What it has returned; None if it has failed.
        error: The exception that it has raised.
    """

    def __init__(self, function: Callable[[], T], loop: Loop) -> None:
        self.ended = Event()
        self.result: T | None = None
        self.error: Exception | None = None
        self._function = function
        self._loop = loop

    def run(self) -> None:
        """Calls the function. Builder thread."""
        try:
            self.result = self._function()
        except Exception as error:
            # The physics thread raises it in the handler of the request.
            self.error = error
        self._loop.inbox.post(self.ended.set)


class WorldBuilder:
    """Changes the recipe of the model, one change after the other.

    Attributes:
        recipe: How the present model is composed. Physics thread.
        on_changed: Called after everything follows the change, before the client gets its response.
        busy: Set when the change that is being made has ended; None if there is none.

    Args:
        loop: The physics loop.
        workers: The worker processes, which need the new model.
        base: The base model.
        digest: Identifies the compiled base model.
        wait: Whether no step is taken while a model is compiled.
    """

    def __init__(self, loop: Loop, workers: WorkerPool, base: Source, digest: str, wait: bool) -> None:
        self.recipe = Recipe(base)
        self.on_changed: list[Callable[[ModelChange], None]] = []
        self._loop = loop
        self._workers = workers
        self._wait = wait
        # The base model as it was compiled at the start, which is used again when nothing is added or removed.
        self._base_model, self._base_digest = loop.simulation.model, digest
        self._base_keys: Mapping[str, tuple[str, ...]] | None = None
        self._keys: Mapping[str, tuple[str, ...]] | None = None
        self.busy: Event | None = None
        self._queue: SimpleQueue[Task[Any] | None] = SimpleQueue()
        self._thread: threading.Thread | None = None

    @property
    def changed(self) -> bool:
        """Whether the present recipe is not the base model alone."""
        return self.recipe != Recipe(self.recipe.base)

    def close(self) -> None:
        """Ends the thread after the task that it runs now."""
        self._queue.put(None)

    def run(self, function: Callable[[], T]) -> Generator[Wait, None, T]:
        """Calls a function in the builder thread; yields what to wait for, and returns its result."""
        task = Task(function, self._loop)
        if self._thread is None:
            self._thread = threading.Thread(target=bound(self._work), name="mjplug builder", daemon=True)
            self._thread.start()
        self._queue.put(task)
        yield task.ended
        if task.error is not None:
            raise task.error
        return task.result  # type: ignore[return-value]

    def change(self, plan: "Callable[[Build], T]") -> Generator[Wait, None, T]:
        """Changes the model, after the changes that were requested before; yields what to wait for.

        Args:
            plan: Called in the builder thread; sets the recipe of the build and returns the result of this generator.
                If it raises an exception, nothing has changed.
        """
        while self.busy is not None:
            yield self.busy
        loop, simulation, token = self._loop, self._loop.simulation, object()
        self.busy = ended = Event()
        try:
            if self._wait:
                loop.lockstep.add(token)
            build = Build(self.recipe, self._keys)
            model, initial, generation = simulation.model, simulation.initial, simulation.generation + 1
            removed_from = simulation.spawned

            def make() -> tuple[T, Replacement | None, Composition | None]:
                result = plan(build)
                if build.recipe == build.before:
                    return result, None, None
                composed = self._compose(build)
                maps = maps_between(self._known_keys(), composed.keys)
                fitted = Fitted(composed.model, mujoco.MjData(composed.model))
                transfer = Transfer(model, composed.model, maps)
                started = _initial(model, initial, composed.model, transfer)
                digest = self._base_digest if composed.model is self._base_model else model_digest(composed.model)
                self._workers.prepare(composed.model)
                spawned = tuple(entity.name for entity in build.recipe.spawned)
                added = tuple(name for name in spawned if name not in removed_from)
                removed = (*(name for name in removed_from if name not in spawned), *build.removed)
                change = ModelChange(generation, added, removed, maps, digest)
                return result, Replacement(fitted, transfer, started, spawned, change), composed

            result, replacement, composed = yield from self.run(make)
            if replacement is not None and composed is not None:
                loop.change_model(replacement)
                self.recipe, self._keys = build.recipe, composed.keys
                for callback in self.on_changed:
                    callback(replacement.change)
            return result
        finally:
            loop.lockstep.discard(token)
            self.busy = None
            ended.set()

    def base_keys(self) -> Mapping[str, tuple[str, ...]]:
        """Returns what identifies each element of the base model, by id. Builder thread."""
        if self._base_keys is None:
            self._base_keys = compose(Recipe(self.recipe.base)).keys
        return self._base_keys

    def _known_keys(self) -> Mapping[str, tuple[str, ...]]:
        return self.base_keys() if self._keys is None else self._keys

    def _compose(self, build: "Build") -> Composition:
        if build.recipe == Recipe(build.recipe.base):
            return Composition(self._base_model, self.base_keys())
        if build.composition is not None and build.composed == build.recipe:
            return build.composition
        return compose(build.recipe)

    def _work(self) -> None:
        while (task := self._queue.get()) is not None:
            task.run()


class Build:
    """One change of a recipe. Builder thread.

    Attributes:
        before: The present recipe.
        recipe: The new recipe; at first the present one.
        keys: What identifies the elements of the present model; None if it is the base model.
        removed: Names of entities of the base model that are removed.
        composition: A composition of `composed`, if the plan had to make one; it is used if `composed` is the recipe.
        composed: See `composition`.
    """

    def __init__(self, recipe: Recipe, keys: Mapping[str, tuple[str, ...]] | None) -> None:
        self.before = self.recipe = recipe
        self.keys = keys
        self.removed: tuple[str, ...] = ()
        self.composition: Composition | None = None
        self.composed: Recipe | None = None

    def compose(self, recipe: Recipe) -> Composition:
        """Composes a recipe, which is not composed again if it becomes `recipe`.

        Raises:
            CompositionError: It cannot be composed.
        """
        self.composition, self.composed = compose(recipe), recipe
        return self.composition


def _initial(
    old: mujoco.MjModel, initial: np.ndarray[tuple[int], np.dtype[np.float64]], new: mujoco.MjModel, transfer: Transfer
) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """Returns the initial state of a changed model: that of the present one, and the defaults of what was added."""
    before, after = mujoco.MjData(old), mujoco.MjData(new)
    mujoco.mj_setState(old, before, initial, _STATE)
    transfer.copy(before, after)
    vector = np.empty(mujoco.mj_stateSize(new, _STATE))
    mujoco.mj_getState(new, after, vector, _STATE)
    return vector
