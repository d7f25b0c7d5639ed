"""The settings of a configuration file: names, units, defaults and allowed values."""

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, WithJsonSchema

from mjplug.config.endpoint import check_endpoint
from mjplug.config.section import Section
from mjplug.config.standard_settings import StandardSettings
from mjplug.convert.options import ConversionOptions
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
            f"a frame prefix must not contain spaces or start with '/', and its only substitution is {NAMESPACE!r}; "
            "write for example 'robot1/' or '{ns}/'"
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


class Sim(Section):
    """Settings of the simulation."""

    speed: Annotated[float, Field(ge=MIN_SPEED, le=MAX_SPEED)] | Literal["max"] = Field(
        1.0, description="Real-time factor, from 0.001 to 1000; `max` runs as fast as possible."
    )
    paused: bool = Field(False, description="Whether the simulation starts paused.")
    keyframe: Keyframe = Field(
        "", description="Name or index of the keyframe to start from; empty means the model's default pose."
    )
    start_position_file: str = Field(
        "", description="An XML file `<key qpos=… qvel=… ctrl=…/>` with the state to start from, not a keyframe."
    )
    initial_positions: dict[str, float] = Field(
        {},
        description="Initial positions of hinge [rad] and slide [m] joints, by name; they override the keyframe or the "
        "file.",
    )
    hold_initial_pose: bool = Field(
        True,
        description="Whether position actuators start with the initial pose as their target, unless a keyframe or a "
        "file sets their controls; with false, their controls are zero.",
    )
    plugin_libraries: Annotated[tuple[str, ...], Field(strict=False)] = Field(
        (), description="Libraries with plugins of the MuJoCo engine, loaded before the model; they run native code."
    )
    seed: int = Field(0, ge=0, lt=1 << 63, description="Seed of all random numbers.")
    clock_rate: float = Field(100.0, gt=0, description="Rate of `/clock` [Hz of simulated time].")
    on_divergence: Literal["pause", "reset", "stop"] = Field(
        "pause", description="Reaction when the state becomes NaN or infinite, or grows above 1e10."
    )


class Zenoh(Section):
    """Settings of the Zenoh session."""

    mode: Literal["auto", "router", "peer", "client"] = Field(
        "auto",
        description="`auto` opens a router; it opens a client if a router already listens there, or with `connect` and "
        "without `listen`.",
    )
    listen: Endpoints | None = Field(
        None,
        description="Endpoints to listen on; port 0 means any free port. The default of a router is "
        "`tcp/127.0.0.1:7447`.",
    )
    connect: Endpoints = Field((), description="Endpoints to connect to.")
    config: str | None = Field(
        None,
        description="A Zenoh configuration file (JSON5) for TLS, users, access control and all other Zenoh settings.",
    )
    max_payload_bytes: int = Field(
        1 << 20,
        ge=1024,
        description="Maximum size of a received message or request [bytes]; larger ones are refused.",
    )
    max_json_bytes: int = Field(
        64 * 1024,
        ge=1024,
        description="Maximum size of a received message or request in JSON [bytes]. Physics waits while JSON is "
        "decoded, at most about 6 ms with the default, and in proportion to this limit. CDR has no such limit.",
    )


class Snapshots(Section):
    """Settings of saved states."""

    max_states: int = Field(
        64, ge=0, description="Maximum number of states in memory, and of those in `folder`; more are refused."
    )
    max_bytes: int = Field(
        256 << 20,
        ge=0,
        description="Maximum size of all states in memory, and of those in `folder` [bytes].",
    )
    folder: str = Field(
        "", description="Folder of states that are saved as files, relative to this file; empty: no files."
    )


class Ros2(Section):
    """Settings for ROS 2 nodes with rmw_zenoh."""

    enabled: bool = Field(True, description="Whether topics and services appear in the ROS 2 graph.")
    domain_id: int = Field(
        0, ge=0, le=232, description="The ROS domain of the nodes; without it, ROS_DOMAIN_ID is used."
    )
    distro: Literal["humble", "jazzy", "kilted", "lyrical", "rolling"] = Field(
        "jazzy", description="The distribution of the nodes. Only Humble differs: it has no type hashes."
    )


class PluginEntry(BaseModel):
    """One plugin instance: its type, and parameters that the plugin validates."""

    model_config = ConfigDict(frozen=True, extra="allow", strict=True)

    type: str = Field(
        min_length=1,
        description="Plugin type: a registered name such as `heartbeat`, a name of mujoco_ros2_control, or "
        "`module:Class`.",
    )
    namespace: Annotated[str, AfterValidator(_relative_or_full)] | None = Field(
        None,
        description="Namespace of this instance: `robot1` is relative to the server's namespace, `/robot1` is "
        "absolute. Default: the server's namespace.",
    )
    frame_prefix: FramePrefix | None = Field(
        None, description="Prefix of this instance's TF frames. Default: the server's prefix."
    )

    @property
    def parameters(self) -> dict[str, Any]:
        """The plugin's own parameters, as in the file."""
        return dict(self.__pydantic_extra__ or {})


class Settings(Section):
    """All settings of a configuration file."""

    model: str = Field(
        min_length=1,
        description="A .xml, .urdf, .xacro, .mjb or .mjz file relative to this file, `package://pkg/path`, "
        "`bundled:NAME`, or `topic:/robot_description` for the URDF or MJCF on a latched topic.",
    )
    model_timeout: float = Field(
        120.0, gt=0, le=86_400, description="How long to wait for a model from a topic [s of wall time]."
    )
    model_options: ConversionOptions = Field(
        ConversionOptions(), description="Options of the conversion of a URDF or xacro file."
    )
    node_name: NodeName = Field(
        "mjplug", description="The server's node name, as in `/<namespace>/<node_name>/set_pause`."
    )
    namespace: Namespace = Field(
        "", description="ROS namespace of every name that is not absolute; empty means the root."
    )
    frame_prefix: FramePrefix = Field(
        "",
        description="Prefix of the TF frames in messages, such as `robot1/`; `{ns}` is replaced by the namespace.",
    )
    remap: dict[FullName, FullName] = Field({}, description="Replacements of full names: `{/clock: '{ns}/clock'}`.")
    sim: Sim = Field(Sim(), description="Settings of the simulation.")
    zenoh: Zenoh = Field(Zenoh(), description="Settings of the Zenoh session.")
    snapshots: Snapshots = Field(Snapshots(), description="Settings of saved states.")
    ros2: Ros2 = Field(Ros2(), description="Settings for ROS 2 nodes with rmw_zenoh.")
    simulation_interfaces: StandardSettings = Field(
        StandardSettings(), description="Settings of the standard control interface of simulators."
    )
    plugins: dict[NodeName, PluginEntry] = Field({}, description="Plugin instances, by instance name.")
    ros_params: Annotated[tuple[str, ...], Field(strict=False)] = Field(
        (), description="ROS parameter files whose `mujoco_plugins` are added; `plugins` overrides them."
    )
    on_plugin_error: Literal["stop", "disable"] = Field(
        "stop",
        description="Reaction to an exception in a plugin's update, timer or subscription: stop the server, or disable "
        "only the plugin instance.",
    )
