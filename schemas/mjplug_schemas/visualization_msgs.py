"""The ROS package visualization_msgs: shapes that RViz and Foxglove draw."""

from typing import ClassVar

from pydantic import Field

from mjplug_schemas.builtin_interfaces import Duration
from mjplug_schemas.geometry_msgs import Point, Pose, Vector3
from mjplug_schemas.idl import boolean, float32, int32, sequence, string, uint8_sequence
from mjplug_schemas.message import Message
from mjplug_schemas.sensor_msgs import CompressedImage
from mjplug_schemas.std_msgs import ColorRGBA, Header


class MeshFile(Message):
    """A mesh that is part of a marker."""

    filename: string = Field("", description="A name for the mesh; its extension determines the format.")
    data: uint8_sequence = Field(b"", description="The contents of the file.")


class UVCoordinate(Message):
    """A position in a texture."""

    u: float32 = Field(0.0, description="Across the texture, from 0 to 1.")
    v: float32 = Field(0.0, description="Up the texture, from 0 to 1.")


class Marker(Message):
    """One shape, or a list of equal shapes."""

    ARROW: ClassVar[int32] = 0
    CUBE: ClassVar[int32] = 1
    SPHERE: ClassVar[int32] = 2
    CYLINDER: ClassVar[int32] = 3
    LINE_STRIP: ClassVar[int32] = 4
    LINE_LIST: ClassVar[int32] = 5
    CUBE_LIST: ClassVar[int32] = 6
    SPHERE_LIST: ClassVar[int32] = 7
    POINTS: ClassVar[int32] = 8
    TEXT_VIEW_FACING: ClassVar[int32] = 9
    MESH_RESOURCE: ClassVar[int32] = 10
    TRIANGLE_LIST: ClassVar[int32] = 11
    ARROW_STRIP: ClassVar[int32] = 12

    ADD: ClassVar[int32] = 0
    MODIFY: ClassVar[int32] = 0
    DELETE: ClassVar[int32] = 2
    DELETEALL: ClassVar[int32] = 3

    header: Header = Field(Header(), description="The frame the pose is in; a zero stamp means its newest transform.")
    ns: string = Field("", description="The namespace that makes `id` unique.")
    id: int32 = Field(0, description="The number of the marker in its namespace; the same again changes or deletes it.")
    type: int32 = Field(0, description="The shape, one of ARROW to ARROW_STRIP.")
    action: int32 = Field(0, description="Action: ADD, MODIFY, DELETE or DELETEALL.")
    pose: Pose = Field(Pose(), description="Pose of the shape in the frame of the header [m].")
    scale: Vector3 = Field(Vector3(), description="The size along each axis; for arrows, shaft and head diameters [m].")
    color: ColorRGBA = Field(ColorRGBA(), description="The colour of the shape.")
    lifetime: Duration = Field(Duration(), description="Lifetime [s, ns]; 0: unlimited.")
    frame_locked: boolean = Field(False, description="Whether the marker moves with its frame.")
    points: sequence[Point] = Field((), description="The points of lists, strips and two-point arrows [m].")
    colors: sequence[ColorRGBA] = Field((), description="One colour for each point, or none.")
    texture_resource: string = Field("", description="The address of a texture, or the name of an embedded one.")
    texture: CompressedImage = Field(CompressedImage(), description="Embedded texture.")
    uv_coordinates: sequence[UVCoordinate] = Field((), description="The place in the texture of each point.")
    text: string = Field("", description="The text of TEXT_VIEW_FACING.")
    mesh_resource: string = Field("", description="The address of a mesh, or the name of an embedded one.")
    mesh_file: MeshFile = Field(MeshFile(), description="Embedded mesh.")
    mesh_use_embedded_materials: boolean = Field(False, description="Whether the mesh keeps its own materials.")


class MarkerArray(Message):
    """Several markers at once."""

    markers: sequence[Marker] = Field((), description="The markers, drawn in this order.")
