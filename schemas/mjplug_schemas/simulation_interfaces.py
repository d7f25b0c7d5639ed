"""The ROS package simulation_interfaces 2.1: the standard control interface of simulators."""

from typing import ClassVar

from pydantic import Field

from mjplug_schemas.action import Action
from mjplug_schemas.geometry_msgs import Accel, Pose, PoseStamped, Twist, Vector3
from mjplug_schemas.idl import boolean, sequence, string, uint8, uint16, uint64
from mjplug_schemas.message import Message, Service
from mjplug_schemas.std_msgs import Header


class Result(Message):
    """Whether a request succeeded."""

    RESULT_FEATURE_UNSUPPORTED: ClassVar[uint8] = 0
    RESULT_OK: ClassVar[uint8] = 1
    RESULT_NOT_FOUND: ClassVar[uint8] = 2
    RESULT_INCORRECT_STATE: ClassVar[uint8] = 3
    RESULT_OPERATION_FAILED: ClassVar[uint8] = 4

    result: uint8 = Field(0, description="One of the constants, or above 100 a constant of the service.")
    error_message: string = Field("", description="Reason of a failure, or additional information.")


class Bounds(Message):
    """A volume."""

    TYPE_EMPTY: ClassVar[uint8] = 0
    TYPE_BOX: ClassVar[uint8] = 1
    TYPE_CONVEX_HULL: ClassVar[uint8] = 2
    TYPE_SPHERE: ClassVar[uint8] = 3

    type: uint8 = Field(0, description="Kind of the volume, one of the constants.")
    points: sequence[Vector3] = Field(
        (),
        description="Box: upper right and lower left corner [m]. Hull: its points [m]. Sphere: center [m], and a point "
        "whose x is the radius [m].",
    )


class EntityCategory(Message):
    """Kind of an entity."""

    CATEGORY_OBJECT: ClassVar[uint8] = 0
    CATEGORY_ROBOT: ClassVar[uint8] = 1
    CATEGORY_HUMAN: ClassVar[uint8] = 2
    CATEGORY_DYNAMIC_OBJECT: ClassVar[uint8] = 4
    CATEGORY_STATIC_OBJECT: ClassVar[uint8] = 5

    category: uint8 = Field(0, description="One of the constants.")


class TagsFilter(Message):
    """Selects by tags."""

    FILTER_MODE_ANY: ClassVar[uint8] = 0
    FILTER_MODE_ALL: ClassVar[uint8] = 1

    tags: sequence[string] = Field((), description="The tags; empty selects everything.")
    filter_mode: uint8 = Field(0, description="Whether one of the tags or all tags must be present.")


class EntityFilters(Message):
    """Selects entities; all parts that are given must hold."""

    filter: string = Field("", description="POSIX extended regular expression, searched in the name; empty: any name.")
    categories: sequence[EntityCategory] = Field((), description="Categories, any of them; empty: all.")
    tags: TagsFilter = Field(TagsFilter(), description="Tags.")
    bounds: Bounds = Field(Bounds(), description="Volume in the world frame that the entity must overlap.")


class EntityInfo(Message):
    """Description of an entity."""

    category: EntityCategory = Field(EntityCategory(), description="Its category.")
    description: string = Field("", description="Text for users.")
    tags: sequence[string] = Field((), description="Its tags.")


class EntityState(Message):
    """Pose and motion of an entity."""

    header: Header = Field(Header(), description="Time of the state, and its frame; an empty frame is the world.")
    pose: Pose = Field(Pose(), description="Pose of the canonical link [m].")
    twist: Twist = Field(Twist(), description="Velocity of its origin [m/s, rad/s].")
    acceleration: Accel = Field(Accel(), description="Acceleration of its origin [m/s², rad/s²].")


class NamedPose(Message):
    """A pose with a name, such as a parking position."""

    name: string = Field("", description="Its name.")
    description: string = Field("", description="Text for users.")
    tags: sequence[string] = Field((), description="Its tags.")
    pose: Pose = Field(Pose(), description="The pose in the world [m].")


class Resource(Message):
    """A model or world: a file, or its content."""

    uri: string = Field("", description="Address of the file.")
    resource_string: string = Field("", description="Content, if `uri` is empty.")


class SimulationState(Message):
    """State of the simulation."""

    STATE_STOPPED: ClassVar[uint8] = 0
    STATE_PLAYING: ClassVar[uint8] = 1
    STATE_PAUSED: ClassVar[uint8] = 2
    STATE_QUITTING: ClassVar[uint8] = 3
    STATE_NO_WORLD: ClassVar[uint8] = 4
    STATE_LOADING_WORLD: ClassVar[uint8] = 5

    state: uint8 = Field(0, description="One of the constants.")


class SimulatorFeatures(Message):
    """What a simulator supports."""

    SPAWNING: ClassVar[uint8] = 0
    DELETING: ClassVar[uint8] = 1
    NAMED_POSES: ClassVar[uint8] = 2
    POSE_BOUNDS: ClassVar[uint8] = 3
    ENTITY_TAGS: ClassVar[uint8] = 4
    ENTITY_BOUNDS: ClassVar[uint8] = 5
    ENTITY_BOUNDS_BOX: ClassVar[uint8] = 6
    ENTITY_BOUNDS_CONVEX: ClassVar[uint8] = 7
    ENTITY_CATEGORIES: ClassVar[uint8] = 8
    SPAWNING_RESOURCE_STRING: ClassVar[uint8] = 9
    ENTITY_STATE_GETTING: ClassVar[uint8] = 10
    ENTITY_STATE_SETTING: ClassVar[uint8] = 11
    ENTITY_INFO_GETTING: ClassVar[uint8] = 12
    ENTITY_INFO_SETTING: ClassVar[uint8] = 13
    SPAWNABLES: ClassVar[uint8] = 14
    SIMULATION_RESET: ClassVar[uint8] = 20
    SIMULATION_RESET_TIME: ClassVar[uint8] = 21
    SIMULATION_RESET_STATE: ClassVar[uint8] = 22
    SIMULATION_RESET_SPAWNED: ClassVar[uint8] = 23
    SIMULATION_STATE_GETTING: ClassVar[uint8] = 24
    SIMULATION_STATE_SETTING: ClassVar[uint8] = 25
    SIMULATION_STATE_PAUSE: ClassVar[uint8] = 26
    STEP_SIMULATION_SINGLE: ClassVar[uint8] = 31
    STEP_SIMULATION_MULTIPLE: ClassVar[uint8] = 32
    STEP_SIMULATION_ACTION: ClassVar[uint8] = 33
    WORLD_LOADING: ClassVar[uint8] = 40
    WORLD_RESOURCE_STRING: ClassVar[uint8] = 41
    WORLD_TAGS: ClassVar[uint8] = 42
    WORLD_UNLOADING: ClassVar[uint8] = 43
    WORLD_INFO_GETTING: ClassVar[uint8] = 44
    AVAILABLE_WORLDS: ClassVar[uint8] = 45
    SPAWNING_ENTITIES: ClassVar[uint8] = 50

    features: sequence[uint16] = Field((), description="The supported features, constants of this message.")
    spawn_formats: sequence[string] = Field((), description="Formats of models that can be spawned.")
    custom_info: string = Field("", description="Limits of this simulator, for users.")


class SpawnEntityMessage(Message, name="SpawnEntity"):
    """A request to spawn one of several entities."""

    name: string = Field("", description="Name of the entity; empty: the name of the model.")
    allow_renaming: boolean = Field(False, description="Whether another name may be chosen if the name is in use.")
    entity_resource: Resource = Field(Resource(), description="The model.")
    entity_namespace: string = Field("", description="ROS namespace of the entity's interfaces.")
    initial_pose: PoseStamped = Field(
        PoseStamped(), description="Pose in the frame of the header [m]; an empty frame is the world."
    )


class SpawnResult(Message):
    """Result of spawning one of several entities."""

    NAME_NOT_UNIQUE: ClassVar[uint8] = 101
    NAME_INVALID: ClassVar[uint8] = 102
    UNSUPPORTED_FORMAT: ClassVar[uint8] = 103
    NO_RESOURCE: ClassVar[uint8] = 104
    NAMESPACE_INVALID: ClassVar[uint8] = 105
    RESOURCE_PARSE_ERROR: ClassVar[uint8] = 106
    MISSING_ASSETS: ClassVar[uint8] = 107
    UNSUPPORTED_ASSETS: ClassVar[uint8] = 108
    INVALID_POSE: ClassVar[uint8] = 109

    result: Result = Field(Result(), description="Whether it was spawned; also the constants of this message.")
    entity_name: string = Field("", description="Name of the entity.")


class Spawnable(Message):
    """A model that can be spawned."""

    entity_resource: Resource = Field(Resource(), description="The model.")
    description: string = Field("", description="Text for users.")
    spawn_bounds: Bounds = Field(Bounds(), description="Its volume at the origin.")


class WorldResource(Message):
    """A world."""

    name: string = Field("", description="Its name.")
    world_resource: Resource = Field(Resource(), description="Its file or content.")
    description: string = Field("", description="Text for users.")
    tags: sequence[string] = Field((), description="Its tags.")


class DeleteEntity(Service):
    """Removes an entity."""

    class Request(Message):
        """The entity."""

        entity: string = Field("", description="Its name.")

    class Response(Message):
        """Whether it was removed."""

        result: Result = Field(Result(), description="Whether it was removed.")


class GetAvailableWorlds(Service):
    """Lists the worlds that can be loaded."""

    class Request(Message):
        """Which worlds to list."""

        additional_sources: sequence[string] = Field((), description="Further places to search.")
        filter: TagsFilter = Field(TagsFilter(), description="Tags of the worlds.")
        offline_only: boolean = Field(False, description="Whether to search local places only.")
        continue_on_error: boolean = Field(False, description="Whether to list the rest if a place cannot be searched.")

    class Response(Message):
        """The worlds."""

        DEFAULT_SOURCES_FAILED: ClassVar[uint8] = 101

        result: Result = Field(Result(), description="Whether the worlds were listed.")
        worlds: sequence[WorldResource] = Field((), description="The worlds.")


class GetCurrentWorld(Service):
    """Returns the loaded world."""

    class Request(Message):
        """No fields."""

    class Response(Message):
        """The world."""

        NO_WORLD_LOADED: ClassVar[uint8] = 101

        result: Result = Field(Result(), description="Whether a world is loaded.")
        world: WorldResource = Field(WorldResource(), description="The world.")


class GetEntities(Service):
    """Lists entities."""

    class Request(Message):
        """Which entities to list."""

        filters: EntityFilters = Field(EntityFilters(), description="The filters; by default, all entities.")

    class Response(Message):
        """Their names."""

        result: Result = Field(Result(), description="Whether the entities were listed.")
        entities: sequence[string] = Field((), description="Names, sorted.")


class GetEntitiesStates(Service):
    """Returns the states of several entities at one time."""

    class Request(Message):
        """Which entities."""

        filters: EntityFilters = Field(EntityFilters(), description="The filters; by default, all entities.")

    class Response(Message):
        """Their states."""

        result: Result = Field(Result(), description="Whether the states were read.")
        entities: sequence[string] = Field((), description="Names, sorted.")
        states: sequence[EntityState] = Field((), description="States, in the order of `entities`.")


class GetEntityBounds(Service):
    """Returns the volume of an entity."""

    class Request(Message):
        """The entity."""

        entity: string = Field("", description="Its name.")

    class Response(Message):
        """Its volume."""

        result: Result = Field(Result(), description="Whether the volume is known.")
        bounds: Bounds = Field(Bounds(), description="The volume in the frame of the canonical link.")


class GetEntityInfo(Service):
    """Returns category, description and tags of an entity."""

    class Request(Message):
        """The entity."""

        entity: string = Field("", description="Its name.")

    class Response(Message):
        """Its description."""

        result: Result = Field(Result(), description="Whether the entity exists.")
        info: EntityInfo = Field(EntityInfo(), description="The description.")


class GetEntityState(Service):
    """Returns pose and motion of an entity."""

    class Request(Message):
        """The entity."""

        entity: string = Field("", description="Its name.")

    class Response(Message):
        """Its state."""

        result: Result = Field(Result(), description="Whether the state was read.")
        state: EntityState = Field(EntityState(), description="The state.")


class GetNamedPoseBounds(Service):
    """Returns the volume of a named pose."""

    class Request(Message):
        """The pose."""

        name: string = Field("", description="Its name.")

    class Response(Message):
        """Its volume."""

        result: Result = Field(Result(), description="Whether the pose exists.")
        bounds: Bounds = Field(Bounds(), description="The volume in the frame of the pose.")


class GetNamedPoses(Service):
    """Lists named poses."""

    class Request(Message):
        """Which poses."""

        tags: TagsFilter = Field(TagsFilter(), description="Tags of the poses.")

    class Response(Message):
        """The poses."""

        result: Result = Field(Result(), description="Whether the poses were listed.")
        poses: sequence[NamedPose] = Field((), description="The poses.")


class GetSimulationState(Service):
    """Returns the state of the simulation."""

    class Request(Message):
        """No fields."""

    class Response(Message):
        """The state."""

        state: SimulationState = Field(SimulationState(), description="The state.")
        result: Result = Field(Result(), description="Whether the state was read.")


class GetSimulatorFeatures(Service):
    """Returns what the simulator supports."""

    class Request(Message):
        """No fields."""

    class Response(Message):
        """The features."""

        features: SimulatorFeatures = Field(SimulatorFeatures(), description="The features.")


class GetSpawnables(Service):
    """Lists the models that can be spawned."""

    class Request(Message):
        """Where to search."""

        sources: sequence[string] = Field((), description="Further places to search.")

    class Response(Message):
        """The models."""

        result: Result = Field(Result(), description="Whether the models were listed.")
        spawnables: sequence[Spawnable] = Field((), description="The models.")


class LoadWorld(Service):
    """Replaces the world."""

    class Request(Message):
        """The new world."""

        world_resource: Resource = Field(Resource(), description="The world.")
        fail_on_unsupported_element: boolean = Field(False, description="Whether an unsupported element is an error.")
        ignore_missing_or_unsupported_assets: boolean = Field(
            False, description="Whether missing assets are left out instead of being an error."
        )

    class Response(Message):
        """The loaded world."""

        UNSUPPORTED_FORMAT: ClassVar[uint8] = 101
        NO_RESOURCE: ClassVar[uint8] = 102
        RESOURCE_PARSE_ERROR: ClassVar[uint8] = 103
        MISSING_ASSETS: ClassVar[uint8] = 104
        UNSUPPORTED_ASSETS: ClassVar[uint8] = 105
        UNSUPPORTED_ELEMENTS: ClassVar[uint8] = 106

        result: Result = Field(Result(), description="Whether it was loaded.")
        world: WorldResource = Field(WorldResource(), description="The world.")


class ResetSimulation(Service):
    """Resets the simulation, or parts of it."""

    class Request(Message):
        """What to reset."""

        SCOPE_DEFAULT: ClassVar[uint8] = 0
        SCOPE_TIME: ClassVar[uint8] = 1
        SCOPE_STATE: ClassVar[uint8] = 2
        SCOPE_SPAWNED: ClassVar[uint8] = 4
        SCOPE_ALL: ClassVar[uint8] = 255

        scope: uint8 = Field(0, description="The constants, added; 0 means everything.")

    class Response(Message):
        """Whether it was reset."""

        result: Result = Field(Result(), description="Whether it was reset.")


class SetEntityInfo(Service):
    """Sets category, description and tags of an entity."""

    class Request(Message):
        """The entity and its description."""

        entity: string = Field("", description="Its name.")
        info: EntityInfo = Field(EntityInfo(), description="The description.")

    class Response(Message):
        """Whether it was set."""

        result: Result = Field(Result(), description="Whether it was set.")


class SetEntityState(Service):
    """Sets pose and motion of an entity."""

    class Request(Message):
        """The entity and its state."""

        entity: string = Field("", description="Its name.")
        state: EntityState = Field(EntityState(), description="The state.")
        set_pose: boolean = Field(False, description="Whether to set the pose.")
        set_twist: boolean = Field(False, description="Whether to set the velocity.")
        set_acceleration: boolean = Field(False, description="Whether to set the acceleration.")

    class Response(Message):
        """Whether it was set."""

        INVALID_POSE: ClassVar[uint8] = 101

        result: Result = Field(Result(), description="Whether it was set.")


class SetSimulationState(Service):
    """Starts, pauses, stops or ends the simulation."""

    class Request(Message):
        """The state."""

        state: SimulationState = Field(SimulationState(), description="The state to enter.")

    class Response(Message):
        """Whether it was entered."""

        ALREADY_IN_TARGET_STATE: ClassVar[uint8] = 101
        STATE_TRANSITION_ERROR: ClassVar[uint8] = 102
        INCORRECT_TRANSITION: ClassVar[uint8] = 103

        result: Result = Field(Result(), description="Whether the state was entered.")


class SpawnEntities(Service):
    """Spawns several entities at once."""

    class Request(Message):
        """The entities."""

        spawn_requests: sequence[SpawnEntityMessage] = Field((), description="The entities.")

    class Response(Message):
        """The results."""

        ENTITIES_SPAWN_FAILED: ClassVar[uint8] = 150

        result: Result = Field(Result(), description="Whether all entities were spawned.")
        results: sequence[SpawnResult] = Field((), description="Results, in the order of the requests.")


class SpawnEntity(Service):
    """Spawns an entity."""

    class Request(Message):
        """The entity."""

        name: string = Field("", description="Name of the entity; empty: the name of the model.")
        allow_renaming: boolean = Field(False, description="Whether another name may be chosen if the name is in use.")
        entity_resource: Resource = Field(Resource(), description="The model.")
        entity_namespace: string = Field("", description="ROS namespace of the entity's interfaces.")
        initial_pose: PoseStamped = Field(
            PoseStamped(), description="Pose in the frame of the header [m]; an empty frame is the world."
        )

    class Response(Message):
        """Whether it was spawned."""

        NAME_NOT_UNIQUE: ClassVar[uint8] = 101
        NAME_INVALID: ClassVar[uint8] = 102
        UNSUPPORTED_FORMAT: ClassVar[uint8] = 103
        NO_RESOURCE: ClassVar[uint8] = 104
        NAMESPACE_INVALID: ClassVar[uint8] = 105
        RESOURCE_PARSE_ERROR: ClassVar[uint8] = 106
        MISSING_ASSETS: ClassVar[uint8] = 107
        UNSUPPORTED_ASSETS: ClassVar[uint8] = 108
        INVALID_POSE: ClassVar[uint8] = 109

        result: Result = Field(Result(), description="Whether it was spawned.")
        entity_name: string = Field("", description="Name of the entity.")


class StepSimulation(Service):
    """Runs a paused simulation for a number of steps."""

    class Request(Message):
        """The number of steps."""

        steps: uint64 = Field(1, description="Number of physics steps.")

    class Response(Message):
        """Whether they were taken."""

        result: Result = Field(Result(), description="Whether all steps were taken.")


class UnloadWorld(Service):
    """Removes the world."""

    class Request(Message):
        """No fields."""

    class Response(Message):
        """Whether it was removed."""

        NO_WORLD_LOADED: ClassVar[uint8] = 101

        result: Result = Field(Result(), description="Whether it was removed.")


class SimulateSteps(Action):
    """Runs a paused simulation for a number of steps, and reports progress."""

    class Goal(Message):
        """The number of steps."""

        steps: uint64 = Field(0, description="Number of physics steps.")

    class Result(Message):
        """Whether they were taken."""

        result: Result = Field(Result(), description="Whether all steps were taken.")

    class Feedback(Message):
        """How far the simulation is."""

        completed_steps: uint64 = Field(0, description="Number of steps that were taken.")
        remaining_steps: uint64 = Field(0, description="Number of steps that are left.")
