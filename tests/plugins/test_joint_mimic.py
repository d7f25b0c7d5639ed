import pytest
from joint_robots import MIXED, compiled

from mjplug.errors import MjplugError
from mjplug.testing import World
from mjplug_plugins.joints import JointCommands
from mjplug_schemas.sensor_msgs import JointState


def world_of(**parameters):
    world = World(compiled(MIXED))
    world.plugin = world.add(JointCommands, "arm", **parameters)
    return world


def command(world, names, **values):
    world.transport.send("/arm/joint_commands", JointState(name=names, **values))
    world.loop.step(1)


def test_a_mimic_joint_follows_with_multiplier_and_offset_and_takes_no_commands_itself():
    world = world_of(
        mimic={"elbow": {"joint": "shoulder", "multiplier": -2.0, "offset": 0.25}},
        pid_gains={"position": {"elbow": {"p": 1.0}}},
    )
    command(world, ["elbow", "shoulder"], position=[9.0, 0.5])
    bank = world.plugin._joints.banks[0]
    assert bank.setpoint[0] == -0.75
    assert world.data.ctrl[1] == 0.5
    assert "elbow" in world.diagnostics.diagnose()["arm"].values["ignored names"]


def test_a_timeout_ends_what_mimics_too():
    world = world_of(mimic={"wrist": {"joint": "elbow", "multiplier": 0.5}}, command_timeout=0.1)
    command(world, ["elbow"], effort=[2.0])
    assert world.data.ctrl[[2, 3]].tolist() == [0.5, 1.0]
    world.loop.step(60)
    assert world.data.ctrl[[2, 3]].tolist() == [0.0, 0.0]


def test_commands_that_only_one_of_two_takes_are_pointed_out(caplog):
    world_of(mimic={"wrist": {"joint": "elbow"}}, pid_gains={"position": {"elbow": {"p": 1.0}}})
    assert [record.message for record in caplog.records] == ["joint wrist does not mimic the position of elbow"]


@pytest.mark.parametrize(
    ("mimic", "sentence"),
    [
        ({"loose": {"joint": "elbow"}}, "joint 'loose' cannot mimic 'elbow', because it has no actuator"),
        ({"wrist": {"joint": "elbw"}}, "unknown commandable joint 'elbw', did you mean 'elbow'"),
        (
            {"wrist": {"joint": "elbow"}, "elbow": {"joint": "shoulder"}},
            "joint 'wrist' mimics 'elbow', which itself mimics another joint",
        ),
        (
            {"wrist": {"joint": "shoulder"}},
            "joint 'wrist' accepts effort commands, but 'shoulder', which it mimics, accepts position",
        ),
    ],
)
def test_what_cannot_be_mimicked_stops_the_start(mimic, sentence):
    with pytest.raises(MjplugError, match=sentence):
        world_of(mimic=mimic)
