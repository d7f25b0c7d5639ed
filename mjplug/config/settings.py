"""What a configuration file can say: names, units, defaults, and what is allowed."""

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, WithJsonSchema

from mjplug.config.endpoint import check_endpoint
from mjplug.limits import MAX_SPEED, MIN_SPEED
from mjplug_schemas.names import NAMESPACE, normalize_namespace, validate_node_name, validate_substituted


def _node_name(text: str) -> str:
    validate_node_name(text)
    return text


def _full_name(text: str) -> str:
    validate_substituted(text)
    return text


def _relative_or_full(text: str) -> str:
    normalize_namespace(text)
    return text


def _frame_prefix(text: str) -> str:
    rest = text.replace(NAMESPACE, "")
    if rest and (text.startswith("/") or any(c in "{}" or c.isspace() for c in rest)):
        raise ValueError(
            f"a frame prefix has no spaces, does not start with '/', and its only substitution is {NAMESPACE!r}; "
            "write for instance 'robot1/' or '{ns}/'"
        )
    return text


NodeName = Annotated[str, AfterValidator(_node_name)]
FullName = Annotated[str, AfterValidator(_full_name)]
Namespace = Annotated[str, AfterValidator(normalize_namespace)]
FramePrefix = Annotated[str, AfterValidator(_frame_prefix)]
Endpoints = Annotated[tuple[Annotated[str, AfterValidator(check_endpoint)], ...], Field(strict=False)]


def _index_as_text(keyframe: object) -> object:
    return str(keyframe) if type(keyframe) is int and keyframe >= 0 else keyframe


Keyframe = Annotated[
    str,
    BeforeValidator(_index_as_text),
    WithJsonSchema({"anyOf": [{"type": "string"}, {"type": "integer", "minimum": 0}]}),
]
"""A keyframe's name, or its index, which YAML reads as a number."""


class Section(BaseModel):
    """A part of the configuration: no unknown keys, and every scalar of exactly its type, though an int is a float."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)


class Sim(Section):
    """How the simulation runs."""

    speed: Annotated[float, Field(ge=MIN_SPEED, le=MAX_SPEED)] | Literal["max"] = Field(
        1.0, description="Real-time factor, from 0.001 to 1000; `max` runs as fast as possible."
    )
    paused: bool = Field(False, description="Whether to start paused.")
    keyframe: Keyframe = Field(
        "", description="Name or index of the keyframe to start from; empty means the model's default pose."
    )
    start_position_file: str = Field(
        "", description="An XML file `<key qpos=… qvel=… ctrl=…/>` with the state to start from, not a keyframe."
    )
    initial_positions: dict[str, float] = Field(
        {}, description="Where hinge and slide joints start [rad, m], by name; laid over the keyframe or the file."
    )
    hold_initial_pose: bool = Field(
        True,
        description="Whether position actuators start with the initial pose as their target where neither a keyframe "
        "nor a file says their controls; false leaves MuJoCo's zeros.",
    )
    plugin_libraries: Annotated[tuple[str, ...], Field(strict=False)] = Field(
        (), description="Libraries with plugins of the MuJoCo engine, loaded before the model; they run native code."
    )
    seed: int = Field(0, ge=0, description="Seed of all random numbers.")
    clock_rate: float = Field(
        100.0, gt=0, description="How often simulated time is published on `/clock` [Hz of simulated time]."
    )
    on_divergence: Literal["pause", "reset", "stop"] = Field(
        "pause", description="What to do when the state becomes NaN or grows without bound."
    )


class Zenoh(Section):
    """How the server gets onto the network."""

    mode: Literal["auto", "router", "peer", "client"] = Field(
        "auto",
        description="`auto` is a router, or a client: of the router that already listens there, or, with `connect` and "
        "without `listen`, of the router that `connect` names.",
    )
    listen: Endpoints | None = Field(
        None,
        description="Endpoints to listen on; port 0 is any free one. A router's default is `tcp/127.0.0.1:7447`.",
    )
    connect: Endpoints = Field((), description="Endpoints to connect to.")
    config: str | None = Field(
        None,
        description="A Zenoh configuration file (JSON5): TLS, users, access control and all else that Zenoh can do.",
    )
    max_payload_bytes: int = Field(
        1 << 20,
        ge=1024,
        description="The longest message or request that is accepted [bytes]; longer ones are refused.",
    )
    max_json_bytes: int = Field(
        64 * 1024,
        ge=1024,
        description="The longest message or request in JSON that is accepted [bytes]. Physics waits while JSON is "
        "decoded, about 6 ms at most with the default, and longer in proportion; CDR has no such limit.",
    )


class Ros2(Section):
    """How ROS 2 nodes on rmw_zenoh see the server."""

    enabled: bool = Field(True, description="Whether topics and services appear in the ROS 2 graph.")
    domain_id: int = Field(
        0, ge=0, le=232, description="The ROS domain of the nodes; where it is not said, ROS_DOMAIN_ID says it."
    )
    distro: Literal["humble", "jazzy", "kilted", "lyrical", "rolling"] = Field(
        "jazzy", description="The distribution of the nodes. Humble has no type hashes; the others are served alike."
    )


class PluginEntry(BaseModel):
    """One plugin instance: its type, and parameters that the plugin itself checks."""

    model_config = ConfigDict(frozen=True, extra="allow", strict=True)

    type: str = Field(
        min_length=1,
        description="Which plugin: a registered name such as `heartbeat`, a name of mujoco_ros2_control's, or "
        "`module:Class`.",
    )
    namespace: Annotated[str, AfterValidator(_relative_or_full)] | None = Field(
        None,
        description="Namespace of this instance: `robot1` is below that of the server, `/robot1` is not; without it, "
        "that of the server.",
    )
    frame_prefix: FramePrefix | None = Field(
        None, description="Prefix of this instance's frames; without it, that of the server."
    )

    @property
    def parameters(self) -> dict[str, Any]:
        """The plugin's own parameters, as they stand in the file."""
        return dict(self.__pydantic_extra__ or {})


class Settings(Section):
    """A whole configuration file."""

    model: str = Field(
        min_length=1,
        description="A .xml, .urdf, .mjb or .mjz file relative to this file, `package://pkg/path`, or `bundled:NAME`.",
    )
    node_name: NodeName = Field(
        "mjplug", description="The server's own name: `/<namespace>/<node_name>/set_pause` and so on."
    )
    namespace: Namespace = Field(
        "", description="ROS namespace of every name that is not given as absolute; empty is the root."
    )
    frame_prefix: FramePrefix = Field(
        "",
        description="Prefix of the TF frames in messages, such as `robot1/`; `{ns}/` stands for the namespace.",
    )
    remap: dict[FullName, FullName] = Field(
        {}, description="Full names, and what they are called instead: `{/clock: '{ns}/clock'}`."
    )
    sim: Sim = Field(Sim(), description="How the simulation runs.")
    zenoh: Zenoh = Field(Zenoh(), description="How the server gets onto the network.")
    ros2: Ros2 = Field(Ros2(), description="How ROS 2 nodes on rmw_zenoh see the server.")
    plugins: dict[NodeName, PluginEntry] = Field(
        {}, description="What runs besides the server's own services, by instance name."
    )
    ros_params: Annotated[tuple[str, ...], Field(strict=False)] = Field(
        (), description="ROS parameter files whose `mujoco_plugins` run too; `plugins` has the last word."
    )
    on_plugin_error: Literal["stop", "disable"] = Field(
        "stop",
        description="What an exception in a plugin's update, timer or subscription does: end the server, or end only "
        "the plugin's work.",
    )
