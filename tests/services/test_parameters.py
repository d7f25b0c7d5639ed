"""The parameters of the server, with the requests of `ros2 param`."""

import pytest

from mjplug.config.settings import Settings, Sim
from mjplug.contracts.parameters import ChangeableParameters, Scalar
from mjplug.services import parameters
from mjplug.services.parameters import MAX_NAMES, ParameterServices, fixed
from mjplug.testing import World
from mjplug_schemas.rcl_interfaces import (
    DescribeParameters,
    GetParameters,
    GetParameterTypes,
    ListParameters,
    Parameter,
    ParameterType,
    ParameterValue,
    SetParameters,
    SetParametersAtomically,
)

YES = ParameterValue(type=ParameterType.PARAMETER_BOOL, bool_value=True)
NO = ParameterValue(type=ParameterType.PARAMETER_BOOL, bool_value=False)
MAX = ParameterValue(type=ParameterType.PARAMETER_STRING, string_value="max")


def double(value):
    return ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=value)


@pytest.fixture
def world(box_model):
    world = World(box_model, speed=0.5, paused=True)
    parameters.offer(
        world.host("mjplug"),
        world.loop,
        Settings(model="bundled:box", sim=Sim(seed=7, speed=0.5)),
        ChangeableParameters(),
    )
    return world


@pytest.fixture
def ask(world):
    return lambda below, request: world.call(f"/mjplug/{below}", request).response


@pytest.fixture
def put(ask):
    """Sets parameters; returns the reason against each, or an empty text."""

    def put(**values):
        given = tuple(Parameter(name=name.replace("__", "."), value=value) for name, value in values.items())
        results = ask("set_parameters", SetParameters.Request(parameters=given)).results
        assert [result.successful for result in results] == [not result.reason for result in results]
        return [result.reason for result in results]

    return put


def test_parameters_are_listed_typed_and_read(ask):
    listed = ask("list_parameters", ListParameters.Request()).result
    of_sim = {f"sim.{name}" for name, value in Sim().model_dump().items() if isinstance(value, Scalar)}
    assert list(listed.names) == sorted({"model", "use_sim_time"} | of_sim)
    assert {"sim.clock_rate", "sim.keyframe", "sim.paused", "sim.seed", "sim.speed"} <= of_sim
    assert listed.prefixes == ("sim",)
    names = ("use_sim_time", "sim.seed", "sim.speed", "model", "sim.paused", "no_such")
    assert ask("get_parameters", GetParameters.Request(names=names)).values == (
        YES,
        ParameterValue(type=ParameterType.PARAMETER_INTEGER, integer_value=7),
        double(0.5),
        ParameterValue(type=ParameterType.PARAMETER_STRING, string_value="bundled:box"),
        YES,
        ParameterValue(),
    )
    assert ask("get_parameter_types", GetParameterTypes.Request(names=names)).types == bytes([1, 2, 3, 4, 1, 0])


def test_descriptions_say_what_a_parameter_is_and_whether_it_can_be_set(ask):
    seed, speed, unknown = ask(
        "describe_parameters", DescribeParameters.Request(names=("sim.seed", "sim.speed", "no_such"))
    ).descriptors
    assert (seed.type, seed.read_only, seed.description) == (2, True, "Seed of all random numbers.")
    assert (speed.type, speed.read_only, speed.dynamic_typing) == (3, False, True)
    assert (unknown.name, unknown.type) == ("no_such", 0)


@pytest.mark.parametrize(
    ("prefixes", "depth", "names"),
    [
        ((), 1, ("model", "use_sim_time")),
        ((), 2, ("model", "sim.seed", "use_sim_time")),
        ((), 0, ("model", "sim.seed", "sim.viewer.on", "use_sim_time")),
        (("sim",), 0, ("sim.seed", "sim.viewer.on")),
        (("sim",), 1, ("sim.seed",)),
        (("sim.viewer", "model"), 1, ("model", "sim.viewer.on")),
        (("si",), 0, ()),
    ],
)
def test_parameters_are_listed_by_group_and_depth(prefixes, depth, names):
    values = {"use_sim_time": True, "sim.seed": 7, "model": "bundled:box", "sim.viewer.on": False}
    services = ParameterServices({name: fixed(value) for name, value in values.items()}, ChangeableParameters())
    _, list_parameters = services.handlers["list_parameters"]
    assert list_parameters(ListParameters.Request(prefixes=prefixes, depth=depth)).result.names == names


def test_what_is_read_only_may_be_set_to_what_it_is(put):
    reasons = put(use_sim_time=YES, sim__paused=YES, model=MAX, sim__seed=double(7.0), sped=YES)
    assert reasons[:2] == ["", ""]
    assert reasons[2] == "parameter 'model': it is read-only; set it in the configuration and restart"
    assert reasons[3] == "parameter 'sim.seed': it is read-only; set it in the configuration and restart"
    assert reasons[4].startswith("unknown parameter 'sped', did you mean 'sim.speed'?; known: model, ")
    assert put(sim__paused=NO) == ["parameter 'sim.paused': it is read-only; use the service ~/set_pause"]


@pytest.mark.parametrize(
    ("value", "speed"),
    [(double(2.5), 2.5), (ParameterValue(type=ParameterType.PARAMETER_INTEGER, integer_value=3), 3.0), (MAX, "max")],
)
def test_the_speed_can_be_set_and_is_read_back(world, put, ask, value, speed):
    assert put(sim__speed=value) == [""]
    assert world.loop.pacer.speed == speed
    (read,) = ask("get_parameters", GetParameters.Request(names=("sim.speed",))).values
    assert read == (value if speed == "max" else double(speed))


@pytest.mark.parametrize("value", [double(0.0), double(-1.0), double(1e308), double(1e-320), double(5e-324),
                                   double(0.0009999), double(1000.1), double(float("inf")), double(float("nan")), YES,
                                   ParameterValue(), ParameterValue(type=4, string_value="fast")])  # fmt: skip
def test_a_wrong_speed_is_refused_and_changes_nothing(world, put, value):
    (reason,) = put(sim__speed=value)
    assert reason.startswith("parameter 'sim.speed': it must be a number from 0.001 to 1000, or 'max', not ")
    assert world.loop.pacer.speed == 0.5


@pytest.mark.parametrize("speed", [0.001, 1000.0])
def test_the_loop_runs_at_the_smallest_and_the_largest_speed(world, put, speed):
    assert put(sim__speed=double(speed)) == [""]
    for _ in range(10):
        world.loop.inbox.post(lambda: None)
        world.loop.turn()
    assert world.loop.pacer.speed == speed


def test_a_new_speed_counts_from_where_the_simulation_is(world):
    pacer = world.loop.pacer
    world.loop.step(100)
    world.loop.set_speed(10.0)
    # The next step is due one period after now, not where the old speed or the start would put it.
    assert pacer.deadline(101) - pacer.deadline(100) == pytest.approx(0.0002)
    assert pacer.due(100, pacer.deadline(100)) == 100


def test_parameters_are_set_atomically_all_or_none(world, ask):
    fast = Parameter(name="sim.speed", value=double(4.0))
    wrong = Parameter(name="use_sim_time", value=NO)
    request = SetParametersAtomically.Request
    refused = ask("set_parameters_atomically", request(parameters=(fast, wrong))).result
    assert (refused.successful, world.loop.pacer.speed) == (False, 0.5)
    assert refused.reason == "parameter 'use_sim_time': it is read-only; set it in the configuration and restart"
    assert ask("set_parameters_atomically", request(parameters=(fast,))).result.successful
    assert world.loop.pacer.speed == 4.0


def test_a_request_with_very_many_names_is_refused_before_any_is_handled(world, ask):
    """Each name takes time on the physics thread."""
    names = ("sim.speed",) * (MAX_NAMES + 1)
    parameters = [Parameter(name=name, value=double(2.0)) for name in names]
    for service, request in (
        ("get_parameters", GetParameters.Request(names=names)),
        ("get_parameter_types", GetParameterTypes.Request(names=names)),
        ("describe_parameters", DescribeParameters.Request(names=names)),
        ("set_parameters", SetParameters.Request(parameters=parameters)),
        ("set_parameters_atomically", SetParametersAtomically.Request(parameters=parameters)),
    ):
        call = world.call(f"/mjplug/{service}", request)
        assert call.refusal == "the request contains 1001 parameters; at most 1000 are accepted"
    assert ask("get_parameters", GetParameters.Request(names=("sim.speed",))).values == (double(0.5),)


def test_the_answer_to_an_unknown_name_does_not_grow_with_the_number_of_parameters():
    services = ParameterServices({f"p{i}": fixed(1) for i in range(5000)}, ChangeableParameters())
    _, set_parameters = services.handlers["set_parameters"]
    (result,) = set_parameters(SetParameters.Request(parameters=[Parameter(name="p5001", value=double(1.0))])).results
    assert result.reason.startswith("unknown parameter 'p5001', did you mean 'p")
    assert len(result.reason) < 300
