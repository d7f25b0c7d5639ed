"""Takes saved states of a loop with all its parts, and puts them back. Physics thread only."""

import logging
from collections.abc import Iterable
from typing import Any

import mujoco
from numpy.typing import NDArray

from mjplug.errors import RequestError
from mjplug.physics import physics_state
from mjplug.physics.loop import Loop
from mjplug.physics.model_change import ModelChange
from mjplug.physics.model_digest import model_digest
from mjplug.physics.part import Part
from mjplug.physics.scheduler import Timer
from mjplug.printable import one_line
from mjplug.services.states.saved_state import (
    ASLEEP,
    PLUGINS,
    RESULTS,
    VECTOR,
    Header,
    PartHeader,
    SavedState,
    SavedTimer,
)

_log = logging.getLogger(__name__)


class Keeper:
    """Saves and restores a loop with its parts.

    Attributes:
        model_digest: Identifies the model, as it was before plugins were started or as it was compiled last.

    Args:
        loop: The physics loop.
        seed: The setting `sim.seed`.
        version: The version of mjplug.
    """

    def __init__(self, loop: Loop, seed: int, version: str) -> None:
        self.model_digest = model_digest(loop.simulation.model)
        self._loop = loop
        self._seed = seed
        self._version = version
        loop.on_model_changed.append(self._model_changed)

    def _model_changed(self, change: ModelChange) -> None:
        self.model_digest = change.digest

    def digest(self) -> str:
        """Returns the digest of the present state vector."""
        simulation = self._loop.simulation
        return physics_state.digest(physics_state.vector_of(simulation.model, simulation.data))

    def save(self) -> SavedState:
        """Returns a copy of the present state."""
        loop, simulation = self._loop, self._loop.simulation
        physics = simulation.save()
        arrays: dict[str, NDArray[Any]] = {VECTOR: physics.vector, ASLEEP: physics.asleep}
        arrays |= {f"{RESULTS}{name}": array for name, array in physics.results.items()}
        parts: dict[str, PartHeader] = {}
        for name, part in self._parts().items():
            saved = part.save()
            arrays |= {f"{PLUGINS}{name}/{key}": array for key, array in saved.arrays.items()}
            timers = {number: _saved_timer(timer, simulation.step) for number, timer in part.timers.items()}
            parts[name] = PartHeader(values=dict(saved.values), left_out=saved.left_out, timers=timers)
        places = self._hold_places()
        header = Header(
            format=1,
            mujoco=mujoco.__version__,
            mjplug=self._version,
            model=self.model_digest,
            seed=self._seed,
            step=simulation.step,
            time_ns=simulation.time_ns,
            time_origin=simulation.time.origin,
            model_generation=simulation.generation,
            epoch=simulation.epoch,
            lineage=simulation.lineage,
            steps_since_reset=loop.recovery.steps_since_reset(simulation.step),
            updating=bool(loop.steppers.active),
            poses_current=physics.poses_current,
            sensors_current=physics.sensors_current,
            digest=physics_state.digest(physics.vector),
            parts=parts,
            holds=tuple(places[id(hold)] for hold in simulation.holds if id(hold) in places),
        )
        return SavedState(header, arrays)

    def restore(
        self, state: SavedState, strict: bool = False, keep_time: bool = False, episode: int | None = None
    ) -> dict[str, str]:
        """Puts a state back; waiting requests are refused, and the epoch grows.

        Args:
            state: The state.
            strict: Whether to refuse if the state of a plugin cannot be restored.
            keep_time: Whether step number and simulated time continue.
            episode: What noise and random numbers depend on, instead of the past of the state; None for the latter.

        Returns:
            Why the state of a plugin was not restored, by instance; `on_reset` of these plugins was called.

        Raises:
            RequestError: The state is refused; nothing has changed.
        """
        self.check(state, keep_time)
        problems = self._problems(state)
        if strict:
            if state.header.seed != self._seed:
                problems["sim.seed"] = f"it is {self._seed} here, and was {state.header.seed}"
            if not problems:
                before = self.save()
                problems = self._put_back(state, {}, keep_time, reset=False)
                if problems:
                    self._return_to(before)
            if problems:
                raise RequestError(f"strict: the state is incomplete ({listing(problems)})")

        def put_back() -> None:
            problems.update(self._put_back(state, problems, keep_time, reset=True, episode=episode))
            self._restore_timers(state)

        self._loop.restore(put_back)
        return problems

    def restart_time(self) -> None:
        """Sets simulated time to zero; everything else continues. Waiting requests are refused, and the epoch grows."""
        loop, simulation, state = self._loop, self._loop.simulation, self.save()

        def put_back() -> None:
            simulation.time.restart(simulation.step)
            self._put_back(state, state.left_out, keep_time=True, reset=True)
            # Noise depends on the time, so it would otherwise be repeated.
            simulation.lineage += 1
            self._restore_timers(state)

        loop.restore(put_back, "simulated time was reset")

    def check(self, state: SavedState, keep_time: bool) -> None:
        """Checks whether this server can restore the physics of a state.

        Args:
            state: The state.
            keep_time: Whether step number and simulated time continue.

        Raises:
            RequestError: It cannot.
        """
        header, loop = state.header, self._loop
        if header.mujoco != mujoco.__version__:
            raise RequestError(f"it was saved with MuJoCo {header.mujoco}; this server uses {mujoco.__version__}")
        if header.model != self.model_digest:
            changed = "; entities were added or removed since the start" if loop.simulation.generation else ""
            raise RequestError(
                f"it was saved with another model, or with another version or configuration of the model{changed}"
            )
        if not keep_time and header.step > loop.end_of_time:
            raise RequestError(f"its step is {header.step}; the last possible one is {loop.end_of_time}")
        if header.time_origin > header.step:
            raise RequestError(f"its step is {header.step}, before the one at which its time is zero")
        loop.simulation.check(state.physics)
        if header.digest != physics_state.digest(state.physics.vector):
            raise RequestError("its digest is not that of its state vector")

    def _return_to(self, before: SavedState) -> None:
        """Sets the state that this server was in a moment ago."""
        lost = self._put_back(before, before.left_out, keep_time=False, reset=False)
        if lost:
            _log.error("plugins could not set their own state back, and are reset: %s", listing(lost))
        for name in lost:
            if stepper := self._parts()[name].stepper:
                stepper.on_reset()

    def _problems(self, state: SavedState) -> dict[str, str]:
        """Returns why the state of a plugin cannot be restored, as far as it is known before."""
        present, saved = self._parts(), state.header.parts
        problems = {name: "it is not in the saved state" for name in present if name not in saved}
        problems |= {name: "there is no such plugin instance now" for name in saved if name not in present}
        for name, part in present.items():
            if name in saved and (reason := part.check(state.part(name)) or _changed_timers(part, saved[name])):
                problems[name] = reason
        return problems

    def _put_back(
        self, state: SavedState, skipped: Iterable[str], keep_time: bool, reset: bool, episode: int | None = None
    ) -> dict[str, str]:
        """Sets the state of the simulation and of the parts, without timers.

        Args:
            state: A state that has been checked.
            skipped: Parts whose state is not restored.
            keep_time: Whether step number and simulated time continue.
            reset: Whether to call `on_reset` of plugins whose state is not restored.
            episode: As for `restore`.

        Returns:
            Why the state of a part could not be restored, by name.
        """
        loop, simulation, header = self._loop, self._loop.simulation, state.header
        if not keep_time:
            simulation.time.restart(header.time_origin)
        simulation.put_back(state.physics, None if keep_time else header.step)
        lineage = simulation.lineage = header.lineage if episode is None else episode
        loop.recovery.restore(simulation.step, header.steps_since_reset)
        problems: dict[str, str] = {}
        restored = []
        for name, part in self._parts().items():
            if reset:
                # Before `on_reset`, which may draw random numbers.
                part.reset(lineage)
            if name in skipped or name not in header.parts:
                continue
            if reason := part.restore(state.part(name), trial=not reset):
                problems[name] = reason
                continue
            if episode is not None:
                part.reset(episode)
            if part.stepper is not None:
                restored.append(part.stepper)
        self._order_holds(header)
        # Plugins that were stopped meanwhile have set them to zero.
        simulation.put_back_forces(state.physics)
        if reset:
            loop.steppers.reset_others(restored)
            if header.updating and not loop.steppers.active:
                # Nobody would clear the forces of the last update.
                simulation.clear_forces()
        return problems

    def _restore_timers(self, state: SavedState) -> None:
        step = self._loop.simulation.step
        phases: dict[Timer, tuple[int, bool]] = {}
        for name, part in self._parts().items():
            saved = state.header.parts.get(name)
            for number, timer in part.timers.items() if saved is not None else ():
                if saved is not None and (own := saved.timers.get(number)) and own.period == _period(timer):
                    phases[timer] = step + own.started, own.due_now
        self._loop.scheduler.restore(step, phases)

    def _parts(self) -> dict[str, Part]:
        """Returns the parts by name; a number is added to a name that is not unique."""
        parts: dict[str, Part] = {}
        for part in self._loop.parts:
            name, count = part.name, 1
            while name in parts:
                count += 1
                name = f"{part.name}#{count}"
            parts[name] = part
        return parts

    def _hold_places(self) -> dict[int, tuple[str, int]]:
        """Returns part and number of each velocity hold, by its `id`."""
        return {id(hold): (name, i) for name, part in self._parts().items() for i, hold in enumerate(part.holds)}

    def _order_holds(self, header: Header) -> None:
        places, rank = self._hold_places(), {place: number for number, place in enumerate(header.holds)}
        self._loop.simulation.holds.sort(key=lambda hold: rank.get(places.get(id(hold), ("", -1)), -1))


def listing(problems: dict[str, str]) -> str:
    """Returns the reasons in one line; they may contain text from a file."""
    return one_line("; ".join(f"{name}: {reason}" for name, reason in problems.items()))


def _period(timer: Timer) -> tuple[int, int]:
    return timer.period_steps.numerator, timer.period_steps.denominator


def _saved_timer(timer: Timer, step: int) -> SavedTimer:
    return SavedTimer(period=_period(timer), started=timer.start - step, due_now=timer.is_due(step))


def _changed_timers(part: Part, saved: PartHeader) -> str:
    """Returns a reason if a part has other timers now than when it was saved; else an empty text."""
    now = {number: _period(timer) for number, timer in part.timers.items()}
    return "" if now == {number: timer.period for number, timer in saved.timers.items()} else "it has other timers now"
