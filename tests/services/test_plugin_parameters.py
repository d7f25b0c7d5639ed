"""Parameters of plugins that change while the server runs, set as `ros2 param set` sets them."""

import math
from enum import StrEnum

import mujoco
import numpy as np
import pytest
from joint_robots import MIXED
from pydantic import Field, model_validator

from mjplug.config.settings import Settings
from mjplug.errors import PluginError, RequestError
from mjplug.physics.simulation import Simulation
from mjplug.plugin import Parameters, Plugin
from mjplug.plugin.selection import Selected
from mjplug.server.offline import OfflineWorkerPool
from mjplug.server.server import Server
from mjplug.services.parameters import parameter_value
from mjplug.testing import FakeTransport
from mjplug_plugins.joints import JointCommands
from mjplug_schemas.rcl_interfaces import (
    DescribeParameters,
    GetParameters,
    ListParameters,
    Parameter,
    ParameterType,
    ParameterValue,
    SetParameters,
    SetParametersAtomically,
)
from mjplug_schemas.sensor_msgs import JointState

GAINS = "plugins.arm.pid_gains.position.wrist"


class Limits(Parameters):
    low: float = Field(default=0.0, description="Lower limit [m].")
    high: float = Field(default=1.0, description="Upper limit [m].")
    count: int = Field(default=3, ge=0, le=9)
    word: str = "a"
    on: bool = False
    numbers: tuple[float, ...] = (1.0,)

    @model_validator(mode="after")
    def _in_order(self):
        if self.low > self.high:
            raise ValueError(f"low, which is {self.low:g}, is above high, which is {self.high:g}")
        return self


class Tuned(Plugin[Limits]):
    def init(self, host, parameters):
        self.host, self.applied = host, []
        host.create_parameters("limits", parameters, self.change)

    def change(self, limits):
        if limits.word == "refuse":
            raise RequestError("this word is refused")
        if limits.word == "fail":
            raise ZeroDivisionError("oops")
        self.applied.append(limits)


class Tools:
    """A server without threads, and its parameter services."""

    def __init__(self, plugins, model, **settings):
        selected = [Selected(name, cls, cls.parameters_type(**given)) for name, (cls, given) in plugins.items()]
        self.transport = FakeTransport()
        simulation = Simulation(mujoco.MjModel.from_xml_string(model))
        self.server = Server(Settings(model="?", **settings), simulation, self.transport, selected, OfflineWorkerPool())
        self.loop = self.server.loop

    def ask(self, name, request):
        call = self.transport.call(f"/mjplug/{name}", request)
        self.loop.step(0)
        return call.response

    def get(self, *names):
        return self.ask("get_parameters", GetParameters.Request(names=names)).values

    def set(self, **values):
        """Sets parameters one by one; returns the reason against each."""
        results = self.ask("set_parameters", SetParameters.Request(parameters=given(values))).results
        assert [result.successful for result in results] == [not result.reason for result in results]
        return [result.reason for result in results]

    def set_together(self, **values):
        request = SetParametersAtomically.Request(parameters=given(values))
        result = self.ask("set_parameters_atomically", request).result
        assert result.successful == (not result.reason)
        return result.reason


def given(values):
    return tuple(
        Parameter(
            name=name.replace("__", "."),
            value=value if isinstance(value, ParameterValue) else parameter_value(value),
        )
        for name, value in values.items()
    )


@pytest.fixture
def opened(request):
    def opened(plugins, model=MIXED, **settings):
        tools = Tools(plugins, model, **settings)
        request.addfinalizer(tools.server.cleanup)
        return tools

    return opened


@pytest.fixture
def tuned(opened):
    return opened({"a": (Tuned, {}), "b": (Tuned, {"high": 5.0})})


def applied(tools, instance="a"):
    return tools.server.plugins[instance].applied


def test_the_plain_parameters_of_plugins_are_listed_described_and_read(tuned):
    names = tuned.ask("list_parameters", ListParameters.Request(prefixes=("plugins.a",))).result.names
    assert names == tuple(f"plugins.a.limits.{name}" for name in ("count", "high", "low", "on", "word"))
    assert tuned.get("plugins.a.limits.high", "plugins.b.limits.high", "plugins.b.limits.numbers") == (
        parameter_value(1.0), parameter_value(5.0), ParameterValue(),
    )  # fmt: skip
    request = DescribeParameters.Request(names=("plugins.a.limits.high", "sim.seed"))
    high, seed = tuned.ask("describe_parameters", request).descriptors
    assert (high.type, high.description, high.read_only) == (ParameterType.PARAMETER_DOUBLE, "Upper limit [m].", False)
    assert not high.dynamic_typing
    assert seed.read_only


def test_a_value_that_is_set_reaches_the_plugin_and_is_read_back(tuned):
    assert tuned.set(plugins__a__limits__high=2.5, plugins__b__limits__count=9) == ["", ""]
    assert [limits.high for limits in applied(tuned)] == [2.5]
    assert [(limits.high, limits.count) for limits in applied(tuned, "b")] == [(5.0, 9)]
    assert tuned.get("plugins.a.limits.high") == (parameter_value(2.5),)


@pytest.mark.parametrize(
    ("name", "value", "reason"),
    [
        ("count", 10, "parameter plugins.a.limits.count: Input should be less than or equal to 9"),
        ("count", 1.0, "parameter plugins.a.limits.count: Input should be a valid integer"),
        ("high", "x", "parameter plugins.a.limits.high: Input should be a valid number"),
        ("high", True, "parameter plugins.a.limits.high: Input should be a valid number"),
        ("high", math.nan, "parameter plugins.a.limits.high: Input should be a finite number"),
        ("high", ParameterValue(), "parameter plugins.a.limits.high: the value must be a number, text, true or false"),
        ("high", -1.0, "parameter plugins.a.limits: low, which is 0, is above high, which is -1"),
        ("numbers", 1.0, "unknown parameter 'plugins.a.limits.numbers'"),
        ("word", "refuse", "parameters plugins.a.limits: this word is refused"),
    ],
)
def test_a_wrong_value_changes_nothing(tuned, name, value, reason):
    (refusal,) = tuned.set(**{f"plugins__a__limits__{name}": value})
    assert reason in refusal
    assert applied(tuned) == []
    assert tuned.get("plugins.a.limits.high", "plugins.a.limits.count") == (parameter_value(1.0), parameter_value(3))


def test_an_integer_is_a_number(tuned):
    assert tuned.set(plugins__a__limits__high=2) == [""]
    assert tuned.get("plugins.a.limits.high") == (parameter_value(2.0),)


class Word(StrEnum):
    A = "a"


class Optionals(Parameters):
    limit: float | None = 1.0
    nothing: float | None = None
    word: Word = Word.A


class Open(Plugin[Optionals]):
    def init(self, host, parameters):
        host.create_parameters("", parameters, lambda values: None)


def test_a_parameter_without_a_group_has_the_name_of_the_instance_and_stays_readable(opened):
    """Values that no ROS parameter can have are neither listed nor accepted."""
    tools = opened({"a": (Open, {})})
    assert tools.ask("list_parameters", ListParameters.Request(prefixes=("plugins",))).result.names == (
        "plugins.a.limit",
    )
    for value in (ParameterValue(), ParameterValue(type=ParameterType.PARAMETER_DOUBLE_ARRAY)):
        assert tools.set(plugins__a__limit=value) == [
            "parameter plugins.a.limit: the value must be a number, text, true or false"
        ]
    assert tools.get("plugins.a.limit", "plugins.a.word") == (parameter_value(1.0), ParameterValue())


def test_parameters_that_are_declared_twice_stop_the_start(opened):
    class Twice(Plugin[Optionals]):
        def init(self, host, parameters):
            for _ in range(2):
                host.create_parameters("g", parameters, lambda values: None)

    with pytest.raises(PluginError, match=r"the parameters plugins.a.g are declared twice"):
        opened({"a": (Twice, {})})


def test_a_parameter_that_is_set_twice_in_one_request_gets_the_last_value(tuned):
    twice = [*given({"plugins__a__limits__high": 2.0}), *given({"plugins__a__limits__high": 3.0})]
    request = SetParametersAtomically.Request(parameters=twice)
    assert tuned.ask("set_parameters_atomically", request).result.successful
    assert [limits.high for limits in applied(tuned)] == [3.0]


def test_parameters_that_are_only_right_together_are_set_together(tuned):
    assert "is above high" in tuned.set(plugins__a__limits__low=2.0)[0]
    assert tuned.set_together(plugins__a__limits__low=2.0, plugins__a__limits__high=3.0) == ""
    assert [(limits.low, limits.high) for limits in applied(tuned)] == [(2.0, 3.0)]


def test_of_an_atomic_request_nothing_is_applied_if_anything_is_wrong(tuned):
    speed = tuned.loop.pacer.speed
    for wrong in ({"plugins__b__limits__count": 10}, {"plugins__b__limits__none": 1}, {"sim__seed": 4}):
        assert tuned.set_together(plugins__a__limits__high=2.0, sim__speed=2.0, **wrong)
    assert applied(tuned) == []
    assert tuned.loop.pacer.speed == speed


def test_what_one_plugin_has_applied_is_taken_back_if_another_one_refuses(tuned):
    reason = tuned.set_together(plugins__a__limits__high=2.0, plugins__b__limits__word="refuse", sim__speed=2.0)
    assert reason == "parameters plugins.b.limits: this word is refused"
    assert [limits.high for limits in applied(tuned)] == [2.0, 1.0]
    assert tuned.get("plugins.a.limits.high", "sim.speed") == (parameter_value(1.0), parameter_value(1.0))


def test_a_plugin_that_fails_over_a_value_is_switched_off(opened):
    tools = opened({"a": (Tuned, {})}, on_plugin_error="disable")
    assert "plugin a failed: ZeroDivisionError" in tools.set(plugins__a__limits__word="fail")[0]
    assert "was disabled after an error" in tools.set(plugins__a__limits__high=2.0)[0]
    assert tools.loop.failure is None


ARM = {
    "pid_gains": {
        "position": {"wrist": {"p": 4.0, "d": 0.1}, "elbow_motor": {"p": 20.0, "i": 5.0, "d": 0.5}},
        "velocity": {"wrist": {"p": 0.5}},
    }
}


@pytest.fixture
def arm(opened):
    arm = opened({"arm": (JointCommands, ARM)})
    arm.transport.send("/arm/joint_commands", JointState(name=["wrist", "elbow"], position=[0.5, -0.2]))
    arm.loop.step(50)
    return arm


def test_the_gains_of_joints_and_actuators_are_parameters(arm):
    names = arm.ask("list_parameters", ListParameters.Request(prefixes=("plugins.arm",))).result.names
    groups = ("position.elbow_motor", "position.wrist", "velocity.wrist")
    assert {name.rpartition(".")[0] for name in names} == {f"plugins.arm.pid_gains.{group}" for group in groups}
    assert {f"{GAINS}.{name}" for name in ("p", "i", "d", "u_clamp_max", "antiwindup_strategy")} <= set(names)
    assert arm.get(f"{GAINS}.p", f"{GAINS}.u_clamp_max") == (parameter_value(4.0), parameter_value(math.inf))


def test_new_gains_act_from_the_next_step_on_as_if_they_had_been_there(arm):
    """The control of the step after the change is that of the control law with the new gains."""
    data, model = arm.loop.simulation.data, arm.loop.simulation.model
    wrist, motor = model.joint("wrist"), model.actuator("wrist_motor").id
    previous = 0.5 - float(data.qpos[wrist.qposadr[0]])
    arm.loop.step(1)
    # The error of the step before is that of the state at its beginning.
    error = 0.5 - float(data.qpos[wrist.qposadr[0]])
    assert arm.set_together(**{f"{GAINS}.p".replace(".", "__"): 9.0, f"{GAINS}.d".replace(".", "__"): 0.3}) == ""
    arm.loop.step(1)
    assert data.ctrl[motor] == pytest.approx(9.0 * error + 0.3 * (error - previous) / 0.002, rel=1e-12)


def test_the_integral_stays_when_its_gain_changes(arm):
    data, model = arm.loop.simulation.data, arm.loop.simulation.model
    elbow = "plugins.arm.pid_gains.position.elbow_motor".replace(".", "__")
    motor, joint = model.actuator("elbow_motor").id, model.joint("elbow").qposadr[0]
    before = float(data.ctrl[motor])
    assert arm.set(**{f"{elbow}__i": 0.0, f"{elbow}__p": 0.0, f"{elbow}__d": 0.0}) == ["", "", ""]
    arm.loop.step(3)
    integral = float(data.ctrl[motor])
    arm.loop.step(3)
    assert integral != 0.0
    assert integral != before
    # Without gains, the output is the integral from before, and no longer grows.
    assert float(data.ctrl[motor]) == integral
    assert np.isfinite(data.qpos[joint])


@pytest.mark.parametrize(("i", "d"), [(-1.0, 1.0), (1.0, -1.0), (-1e-200, 1e-200), (-1.0, 0.0)])
def test_gains_without_a_time_constant_for_back_calculation_are_refused(arm, i, d):
    """The default of the time constant is a square root, or negative."""
    name = "plugins.arm.pid_gains.position.elbow_motor".replace(".", "__")
    gains = {f"{name}__i": i, f"{name}__d": d, f"{name}__antiwindup_strategy": "back_calculation"}
    assert "back_calculation needs a tracking_time_constant above 0" in arm.set_together(**gains)
    assert arm.set_together(**gains, **{f"{name}__tracking_time_constant": 0.5}) == ""
    arm.loop.step(2)
    assert arm.loop.failure is None


@pytest.mark.parametrize("gains", [{"d": 1e308}, {"p": -1e13}, {"i": 1e308, "p": 1e308}])
def test_gains_that_could_overflow_are_refused(arm, gains):
    assert "Input should be " in arm.set_together(
        **{f"{GAINS}.{gain}".replace(".", "__"): value for gain, value in gains.items()}
    )


def test_a_tiny_time_constant_leaves_the_control_a_number(arm):
    """Otherwise MuJoCo would set all controls to zero, and new gains could not mend the integral."""
    name = "plugins.arm.pid_gains.position.elbow_motor".replace(".", "__")
    values = {
        "tracking_time_constant": 5e-324,
        "i": 1e12,
        "p": 1e12,
        "d": 1e12,
        "antiwindup_strategy": "back_calculation",
    }
    assert arm.set_together(**{f"{name}__{gain}": value for gain, value in values.items()}) == ""
    arm.loop.step(200)
    assert np.isfinite(arm.loop.simulation.data.ctrl).all()


def test_all_gains_can_be_zero(arm):
    name = "plugins.arm.pid_gains.position.elbow_motor".replace(".", "__")
    for strategy in ("none", "back_calculation", "conditional_integration"):
        values = {f"{name}__{gain}": 0.0 for gain in "pid"}
        assert arm.set_together(**values, **{f"{name}__antiwindup_strategy": strategy}) == ""
        arm.loop.step(2)
    assert arm.loop.failure is None
    assert np.isfinite(arm.loop.simulation.data.ctrl).all()


def test_gains_that_are_not_right_together_are_refused_and_the_old_ones_act_on(arm):
    name = GAINS.replace(".", "__")
    assert "must not be above u_clamp_max" in arm.set_together(
        **{f"{name}__u_clamp_min": 2.0, f"{name}__u_clamp_max": 1.0, f"{name}__p": 100.0}
    )
    assert arm.get(f"{GAINS}.p", f"{GAINS}.u_clamp_max") == (parameter_value(4.0), parameter_value(math.inf))
    assert "antiwindup_strategy: Input should be 'none', " in arm.set(**{f"{name}__antiwindup_strategy": "x"})[0]
