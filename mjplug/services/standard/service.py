"""Declares the 22 services of simulation_interfaces."""

from collections.abc import Callable, Generator
from typing import Any

from mjplug.config.standard_settings import StandardSettings
from mjplug.model.library import Library
from mjplug.physics.loop import Loop
from mjplug.physics.scheduler import Event, Wait
from mjplug.plugin import Call, Host, Slow
from mjplug.services.standard import features
from mjplug.services.standard.bounds import bounds_of
from mjplug.services.standard.configured import entities_of, places_of
from mjplug.services.standard.entities import CATEGORIES, Entities
from mjplug.services.standard.entity_states import WORLD, messages_at, rows_of, set_state, states_of
from mjplug.services.standard.filters import selected
from mjplug.services.standard.named_poses import NamedPoses
from mjplug.services.standard.replies import UNSUPPORTED, ResultError, done, replying
from mjplug.services.standard.run_state import RunState, steps_failed
from mjplug.services.standard.spawning import Spawning
from mjplug.services.standard.world_builder import WorldBuilder
from mjplug.services.stepping.ownership import Ownership
from mjplug_schemas import simulation_interfaces as standard
from mjplug_schemas.builtin_interfaces import Time
from mjplug_schemas.message import Message, Service
from mjplug_schemas.std_msgs import Header

_AT_ONCE = 20
"""Number of states that are made into messages between two steps."""


def offer(
    host: Host,
    loop: Loop,
    settings: StandardSettings,
    ownership: Ownership,
    restart_time: Callable[[], None],
    world: standard.WorldResource,
    builder: WorldBuilder | None = None,
    library: Library | None = None,
) -> "Standard":
    """Declares the services.

    Args:
        host: The host of the server.
        loop: The physics loop.
        settings: The setting `simulation_interfaces`.
        ownership: Which client steps the server.
        restart_time: Sets simulated time to zero, without other changes.
        world: The loaded world.
        builder: Changes the model; None if the model cannot be changed.
        library: The models that clients may add.
    """
    entities = Entities(loop.simulation, entities_of(settings))
    spawning = None
    if builder is not None:
        spawning = Spawning(loop.simulation, entities, builder, library or Library(()))
    restore_base = _nothing_to_restore if spawning is None else spawning.restore_base
    run = RunState(loop, entities, ownership, restart_time, restore_base, settings.allow_quit)
    poses = NamedPoses(loop.simulation, places_of(settings))
    offered = Standard(host, loop, settings, entities, run, poses, world, spawning)
    offered.declare()
    return offered


class Standard:
    """Handles the requests to the standard services. Physics thread only.

    Args:
        host: The host of the server.
        loop: The physics loop.
        settings: The setting `simulation_interfaces`.
        entities: The entities.
        run: The run state.
        poses: The named poses.
        world: The loaded world.
        spawning: Adds and removes entities; None if the model cannot be changed.
    """

    def __init__(
        self,
        host: Host,
        loop: Loop,
        settings: StandardSettings,
        entities: Entities,
        run: RunState,
        poses: NamedPoses,
        world: standard.WorldResource,
        spawning: Spawning | None,
    ) -> None:
        self._host = host
        self._simulation = loop.simulation
        self._inbox = loop.inbox
        self._prefix = "{ns}" if settings.namespace is None else settings.namespace
        self._features = features.Features(settings, spawning is not None)
        self._spawning = spawning
        self._entities = entities
        self._run = run
        self._poses = poses
        self._world = world

    def declare(self) -> None:
        """Declares the services."""
        run = self._run
        handlers: dict[type[Service], Callable[[Any, Call], Any]] = {
            standard.GetSimulatorFeatures: self._get_features,
            standard.GetSimulationState: run.get,
            standard.SetSimulationState: run.set,
            standard.StepSimulation: run.step,
            standard.ResetSimulation: run.reset,
            standard.GetEntities: self._get_entities,
            standard.GetEntitiesStates: self._get_entities_states,
            standard.GetEntityState: self._get_entity_state,
            standard.SetEntityState: self._set_entity_state,
            standard.GetEntityInfo: self._get_entity_info,
            standard.SetEntityInfo: self._set_entity_info,
            standard.GetEntityBounds: self._get_entity_bounds,
            standard.GetNamedPoses: self._get_named_poses,
            standard.GetNamedPoseBounds: self._get_named_pose_bounds,
            standard.GetCurrentWorld: self._get_current_world,
        }
        for unsupported in (
            standard.LoadWorld,
            standard.UnloadWorld,
            standard.GetAvailableWorlds,
        ):
            handlers[unsupported] = _unsupported
        spawning = self._spawning
        handlers |= {
            standard.SpawnEntity: _unsupported if spawning is None else spawning.spawn,
            standard.SpawnEntities: _unsupported if spawning is None else spawning.spawn_all,
            standard.DeleteEntity: _unsupported if spawning is None else spawning.delete,
            standard.GetSpawnables: _unsupported if spawning is None else spawning.spawnables,
        }
        self._host.create_action(
            standard.SimulateSteps, f"{self._prefix}/simulate_steps", run.simulate, on_abort=steps_failed
        )
        for service, handler in handlers.items():
            name = service_name(service)
            self._host.create_service(service, f"{self._prefix}/{name}", replying(handler, service.Response))

    def _get_features(self, request: Message, call: Call) -> Message:
        return standard.GetSimulatorFeatures.Response(features=self._features.message())

    def _get_entities(self, request: standard.GetEntities.Request, call: Call) -> Message:
        found = selected(self._simulation, self._entities, request.filters)
        return standard.GetEntities.Response(result=done(), entities=tuple(entity.name for entity in found))

    def _get_entities_states(self, request: standard.GetEntitiesStates.Request, call: Call) -> Slow:
        simulation = self._simulation
        found = selected(simulation, self._entities, request.filters)
        rows = rows_of(simulation, found)
        header = Header(stamp=Time.from_ns(simulation.time_ns), frame_id=WORLD)
        states = messages_at(header, rows[:_AT_ONCE])
        for begin in range(_AT_ONCE, len(rows), _AT_ONCE):
            # Steps may be taken between parts of a long list, whose numbers were read at one time.
            turn = Event()
            self._inbox.post(turn.set)
            yield turn
            states += messages_at(header, rows[begin : begin + _AT_ONCE])
        return standard.GetEntitiesStates.Response.unchecked(
            result=done(),
            entities=tuple(entity.name for entity in found),
            states=tuple(states),
        )

    def _get_entity_state(self, request: standard.GetEntityState.Request, call: Call) -> Message:
        (state,) = states_of(self._simulation, [self._entities.get(request.entity)])
        return standard.GetEntityState.Response.unchecked(result=done(), state=state)

    def _set_entity_state(self, request: standard.SetEntityState.Request, call: Call) -> Message:
        note = set_state(self._simulation, self._entities, request)
        self._run.touched()
        return standard.SetEntityState.Response(result=done(note))

    def _get_entity_info(self, request: standard.GetEntityInfo.Request, call: Call) -> Message:
        return standard.GetEntityInfo.Response(result=done(), info=self._entities.info(request.entity))

    def _set_entity_info(self, request: standard.SetEntityInfo.Request, call: Call) -> Message:
        category = request.info.category.category
        if category not in CATEGORIES.values():
            known = ", ".join(f"{number} ({name})" for name, number in CATEGORIES.items())
            raise ResultError(4, f"category is {category}; it must be one of {known}")
        self._entities.set_info(request.entity, request.info)
        return standard.SetEntityInfo.Response(result=done())

    def _get_entity_bounds(self, request: standard.GetEntityBounds.Request, call: Call) -> Message:
        bounds = bounds_of(self._simulation, self._entities.get(request.entity))
        return standard.GetEntityBounds.Response(result=done(), bounds=bounds)

    def _get_named_poses(self, request: standard.GetNamedPoses.Request, call: Call) -> Message:
        return standard.GetNamedPoses.Response(result=done(), poses=tuple(self._poses.poses(request.tags)))

    def _get_named_pose_bounds(self, request: standard.GetNamedPoseBounds.Request, call: Call) -> Message:
        return standard.GetNamedPoseBounds.Response(result=done(), bounds=self._poses.bounds(request.name))

    def _get_current_world(self, request: Message, call: Call) -> Message:
        return standard.GetCurrentWorld.Response(result=done(), world=self._world)


def service_name(service: type[Service]) -> str:
    """Returns the last part of a service's name: `get_entities` for GetEntities."""
    short = service.TYPE.rpartition("/")[2]
    return "".join(f"_{letter.lower()}" if letter.isupper() else letter for letter in short).lstrip("_")


def _nothing_to_restore(deleted_too: bool) -> Generator[Wait, None, None]:
    yield from ()


def _unsupported(request: Message, call: Call) -> Message:
    raise ResultError(UNSUPPORTED, "this server does not support it; see get_simulator_features")
