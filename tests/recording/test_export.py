"""Tables of topics, read by others."""

import csv

import pyarrow.parquet
import pytest
from cli.tour import typed
from recording.test_bags import new_bag

from mjplug.bag.definitions import text_of_class
from mjplug.bag.topics import BagTopic
from mjplug.bag.writer import Record
from mjplug_schemas.builtin_interfaces import Time
from mjplug_schemas.geometry_msgs import Point, Pose, PoseStamped
from mjplug_schemas.sensor_msgs import Image, JointState, LaserScan
from mjplug_schemas.std_msgs import Header, UInt64


def bag_of(folder, **messages):
    """A bag with messages by topic, 0.25 s apart."""
    bag = new_bag(folder)
    for name, them in messages.items():
        bag.add_topic(BagTopic(f"/{name}", them[0].TYPE, text_of_class(type(them[0]))))
        for number, message in enumerate(them):
            bag.write(Record(f"/{name}", 1_000_000_001 + number * 250_000_000, 5, number + 1, message.to_cdr()))
    bag.finish()
    return str(folder)


def table(path):
    with open(path, newline="", encoding="utf-8") as file:
        return [*csv.DictReader(file)]


JOINTS = [
    JointState(header=Header(stamp=Time(sec=3, nanosec=250_000_000)), name=("a", "b"), position=(0.5, -1.0)),
    JointState(name=("b", "a", "c"), position=(1.0, 2.0, float("nan")), velocity=(7.0, 8.0, 9.0)),
    JointState(),
]


def test_each_number_and_text_has_a_column_and_joints_have_their_names(tmp_path):
    done = typed("bag", "export", bag_of(tmp_path / "bag", joints=JOINTS), "-o", str(tmp_path / "out"))
    assert (done.code, done.out) == (0, f"{tmp_path}/out/joints.csv: 3 rows of /joints\n")
    first, second, third = table(tmp_path / "out" / "joints.csv")
    assert [first[c] for c in ("t", "log_time_ns", "publish_time_ns")] == ["1.000000001", "1000000001", "5"]
    assert [second["t"], third["t"]] == ["1.250000001", "1.500000001"]
    assert (first["header.stamp"], first["header.frame_id"]) == ("3.25", "")
    assert (first["position[a]"], first["position[b]"], first["position[c]"]) == ("0.5", "-1.0", "")
    assert (second["position[a]"], second["position[b]"], second["position[c]"]) == ("2.0", "1.0", "nan")
    assert (second["velocity[c]"], second["name[0]"], first["velocity[c]"]) == ("9.0", "b", "")
    assert {value for name, value in third.items() if name.startswith(("position", "name"))} == {""}


def test_parquet_has_the_same_values_with_types(tmp_path):
    large = [UInt64(data=0), UInt64(data=2**63 - 1)]
    bag = bag_of(tmp_path / "bag", joints=JOINTS, **{"deep/count": large})
    assert typed("bag", "export", bag, "--parquet", "-o", str(tmp_path / "out")).code == 0
    read = pyarrow.parquet.read_table(tmp_path / "out" / "joints.parquet").to_pylist()
    assert [row["log_time_ns"] for row in read] == [1_000_000_001, 1_250_000_001, 1_500_000_001]
    assert [row["position[a]"] for row in read] == [0.5, 2.0, None]
    assert [row["name[0]"] for row in read] == ["a", "b", None]
    counts = pyarrow.parquet.read_table(tmp_path / "out" / "deep_count.parquet")
    assert counts.column("data").to_pylist() == [0, 2**63 - 1]
    assert str(counts.schema.field("data").type) == "int64"


def test_nested_fields_arrays_and_what_is_too_long_for_columns(tmp_path):
    pose = PoseStamped(pose=Pose(position=Point(x=1.0, y=2.0, z=3.0)))
    scan, picture = LaserScan(ranges=(1.0, float("inf"))), Image(data=bytes(300))
    bag = bag_of(tmp_path / "bag", pose=[pose], scan=[scan], picture=[picture])
    assert typed("bag", "export", bag, "pose", "/scan", "picture", "-o", str(tmp_path / "out")).code == 0
    (row,) = table(tmp_path / "out" / "pose.csv")
    assert [row[f"pose.position.{axis}"] for axis in "xyz"] == ["1.0", "2.0", "3.0"]
    assert row["pose.orientation.w"] == "1.0"
    (row,) = table(tmp_path / "out" / "scan.csv")
    assert (row["ranges[0]"], row["ranges[1]"]) == ("1.0", "inf")
    (row,) = table(tmp_path / "out" / "picture.csv")
    assert row["data.length"] == "300"
    assert typed("bag", "export", bag, "scan", "--max-array", "1", "-o", str(tmp_path / "short")).code == 0
    (row,) = table(tmp_path / "short" / "scan.csv")
    assert row["ranges.length"] == "2"
    assert "ranges[0]" not in row


@pytest.mark.parametrize(
    ("words", "code", "why"),
    [
        (("/joint",), 1, "did you mean '/joints'"),
        (("--csv", "--parquet"), 2, "choose one"),
        (("-o", "."), 1, "already exists"),
    ],
)
def test_mistakes_are_named(tmp_path, words, code, why):
    done = typed("bag", "export", bag_of(tmp_path / "bag", joints=JOINTS), *words)
    assert (done.code, why in done.err) == (code, True), done
