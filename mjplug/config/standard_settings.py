"""The setting `simulation_interfaces`: names, units, defaults and allowed values."""

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field, model_validator

from mjplug.config.section import Section
from mjplug_schemas.names import normalize_namespace

Vector = Annotated[tuple[float, float, float], Field(strict=False)]
Texts = Annotated[tuple[str, ...], Field(strict=False)]
Category = Literal["object", "robot", "human", "dynamic_object", "static_object"]


def _orientation(values: tuple[float, float, float, float]) -> tuple[float, float, float, float]:
    if not any(abs(value) > 1e-9 for value in values):
        raise ValueError("the norm of an orientation must not be zero; no rotation is [0, 0, 0, 1]")
    return values


class EntitySettings(Section):
    """A body of the model as an entity."""

    body: str = Field("", description="A child body of the world; empty: the body with the name of the entity.")
    category: Category | None = Field(
        None,
        description="`object`, `robot`, `human`, `dynamic_object` or `static_object`. Default: from joints and "
        "actuators.",
    )
    tags: Texts = Field((), description="Tags.")
    description: str = Field("", description="Text for users.")


class BoundsSettings(Section):
    """A volume in the frame of a named pose."""

    box: Annotated[tuple[Vector, Vector], Field(strict=False)] | None = Field(
        None, description="Two opposite corners of a box [m]."
    )
    sphere: float | None = Field(None, gt=0, description="Radius of a sphere [m].")

    @model_validator(mode="after")
    def _one(self) -> Any:
        if (self.box is None) == (self.sphere is None):
            raise ValueError("bounds need exactly one of box and sphere")
        return self


class NamedPoseSettings(Section):
    """A pose with a name."""

    site: str = Field("", description="The site whose pose it is; empty: a fixed pose in the world.")
    position: Vector = Field((0.0, 0.0, 0.0), description="Position in the world [m], without a site.")
    orientation: Annotated[tuple[float, float, float, float], Field(strict=False), AfterValidator(_orientation)] = (
        Field((0.0, 0.0, 0.0, 1.0), description="Orientation in the world, a quaternion (x, y, z, w), without a site.")
    )
    tags: Texts = Field((), description="Tags.")
    description: str = Field("", description="Text for users.")
    bounds: BoundsSettings | None = Field(None, description="Volume around the pose.")


class StandardSettings(Section):
    """Settings of the standard control interface of simulators."""

    enabled: bool = Field(True, description="Whether the services of simulation_interfaces are provided.")
    namespace: Annotated[str, AfterValidator(normalize_namespace)] | None = Field(
        None, description="Namespace of the services. Default: the server's namespace."
    )
    allow_quit: bool = Field(False, description="Whether clients may end the server with the state QUITTING.")
    spawnables: Texts = Field(
        (), description="Folders with models that clients may spawn, relative to this file; others are refused."
    )
    spawn_wait: bool = Field(
        False,
        description="Whether simulated time waits while a changed model is compiled, so that runs are repeatable.",
    )
    entities: dict[str, EntitySettings] = Field({}, description="Descriptions of entities, by name.")
    named_poses: dict[str, NamedPoseSettings] = Field({}, description="Poses with names, such as parking positions.")
