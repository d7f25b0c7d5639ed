"""simulation_interfaces 1.4 to 1.6, as in Humble, Jazzy and Kilted: the services that differ from version 2.1.

The bytes of SpawnEntity and LoadWorld are the same as in 2.1, because `uri` and `resource_string` became a message.
"""

from pydantic import Field

from mjplug_schemas.geometry_msgs import PoseStamped
from mjplug_schemas.idl import boolean, sequence, string
from mjplug_schemas.message import Message, Service
from mjplug_schemas.simulation_interfaces import Bounds, EntityState, Result
from mjplug_schemas.simulation_interfaces import LoadWorld as NewLoadWorld
from mjplug_schemas.simulation_interfaces import SetEntityState as NewSetEntityState
from mjplug_schemas.simulation_interfaces import SpawnEntity as NewSpawnEntity

PACKAGE = "simulation_interfaces"


class Spawnable(Message, package=PACKAGE):
    """A model that can be spawned."""

    uri: string = Field("", description="Address of the file.")
    description: string = Field("", description="Text for users.")
    spawn_bounds: Bounds = Field(Bounds(), description="Its volume at the origin.")


class GetSpawnables(Service, package=PACKAGE):
    """Lists the models that can be spawned."""

    class Request(Message):
        """Where to search."""

        sources: sequence[string] = Field((), description="Further places to search.")

    class Response(Message):
        """The models."""

        result: Result = Field(Result(), description="Whether the models were listed.")
        spawnables: sequence[Spawnable] = Field((), description="The models.")


class LoadWorld(Service, package=PACKAGE):
    """Replaces the world."""

    class Request(Message):
        """The new world."""

        uri: string = Field("", description="Address of the file.")
        resource_string: string = Field("", description="Content, if `uri` is empty.")
        fail_on_unsupported_element: boolean = Field(False, description="Whether an unsupported element is an error.")
        ignore_missing_or_unsupported_assets: boolean = Field(
            False, description="Whether missing assets are left out instead of being an error."
        )

    Response = NewLoadWorld.Response


class SetEntityState(Service, package=PACKAGE):
    """Sets pose and motion of an entity."""

    class Request(Message):
        """The entity and its state."""

        entity: string = Field("", description="Its name.")
        state: EntityState = Field(EntityState(), description="The state.")

    Response = NewSetEntityState.Response


class SpawnEntity(Service, package=PACKAGE):
    """Spawns an entity."""

    class Request(Message):
        """The entity."""

        name: string = Field("", description="Name of the entity; empty: the name of the model.")
        allow_renaming: boolean = Field(False, description="Whether another name may be chosen if the name is in use.")
        uri: string = Field("", description="Address of the file.")
        resource_string: string = Field("", description="Content, if `uri` is empty.")
        entity_namespace: string = Field("", description="ROS namespace of the entity's interfaces.")
        initial_pose: PoseStamped = Field(
            PoseStamped(), description="Pose in the frame of the header [m]; an empty frame is the world."
        )

    Response = NewSpawnEntity.Response
