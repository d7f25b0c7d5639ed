"""What every registered plugin must do, built in or not."""

import logging

import pytest
from pydantic import ValidationError

from mjplug.errors import MjplugError
from mjplug.physics.reset import Reset
from mjplug.plugin import Parameters, Plugin, registry
from mjplug.testing import World
from mjplug_schemas.names import validate_name

CLASSES = sorted({point.load() for point in registry.registered().values()}, key=lambda c: c.__name__)

REQUIRED: dict[str, dict[str, object]] = {
    "BaseVelocity": {"body": "cube"},
    "OdometryPublisher": {"body": "cube"},
    "RobotDescription": {"file": "bundled:box"},
}
"""Parameters without which a plugin refuses to start, by class name."""

DRIVING = {"BaseVelocity"}
"""Plugins whose purpose is to act on the model at every step."""


def start(world, plugin_class, name="instance"):
    return world.add(plugin_class, name, **REQUIRED.get(plugin_class.__name__, {}))


@pytest.fixture(params=CLASSES, ids=lambda c: c.__name__)
def plugin_class(request):
    return request.param


def test_it_is_documented_and_so_is_every_parameter(plugin_class):
    assert plugin_class.__doc__
    assert issubclass(plugin_class, Plugin)
    for name, field in plugin_class.parameters_type.model_fields.items():
        assert field.description, f"parameter {name} has no description"


def test_its_parameters_are_frozen_and_refuse_unknown_names(plugin_class):
    parameters = plugin_class.parameters_type
    assert issubclass(parameters, Parameters)
    assert parameters.model_config["frozen"]
    with pytest.raises(ValidationError, match="Extra inputs"):
        parameters(**REQUIRED.get(plugin_class.__name__, {}), no_such_parameter=1)


def test_its_state_can_be_saved_and_restored(plugin_class, arm_model):
    world = World(arm_model)
    start(world, plugin_class)
    world.step(50)
    state = world.save()
    assert state.left_out == {}
    world.step(100)
    world.restore(state)
    again = world.save()
    assert (again.header.parts, again.header.digest) == (state.header.parts, state.header.digest)
    assert again.arrays.keys() == state.arrays.keys()


def test_its_life_leaves_nothing_active(plugin_class, arm_model):
    world = World(arm_model)
    plugin = start(world, plugin_class)
    world.loop.step(700)
    world.loop.reset(Reset())
    world.loop.step(700)
    assert not world.data.xfrc_applied.any()
    plugin.cleanup()
    plugin.cleanup()


def test_cleanup_after_an_init_that_never_ran_does_not_fail(plugin_class):
    plugin_class().cleanup()


def test_its_names_are_valid_ros_names_and_its_publications_encode_both_ways(plugin_class, arm_model):
    world = World(arm_model)
    start(world, plugin_class)
    world.loop.step(1000)
    for name in {*world.transport.publishers, *world.transport.services, *world.transport.subscriptions}:
        validate_name(name)
    for publisher in world.transport.publishers.values():
        for message in publisher.messages:
            assert type(message).from_cdr(message.to_cdr()) == message
            assert type(message).from_json(message.to_json()) == message


@pytest.mark.parametrize("plugin_class", [c for c in CLASSES if c.__name__ not in DRIVING], ids=lambda c: c.__name__)
def test_it_does_not_disturb_physics_when_nobody_asks_it_to(plugin_class, arm_model):
    alone, with_plugin = World(arm_model), World(arm_model)
    start(with_plugin, plugin_class)
    alone.loop.step(1000)
    with_plugin.loop.step(1000)
    assert (alone.data.qpos == with_plugin.data.qpos).all()


def test_two_instances_do_not_share_names(plugin_class, arm_model):
    world = World(arm_model)
    start(world, plugin_class, "one")
    own = {n for n in {*world.transport.publishers, *world.transport.services} if n.startswith("/one/")}
    start(world, plugin_class, "two")
    assert {n.replace("/one/", "/two/") for n in own} <= {*world.transport.publishers, *world.transport.services}


class Fragile(Plugin[Parameters]):
    """Fails in the configured method."""

    def init(self, host, parameters):
        host.create_timer(0.01, self._fail)

    def _fail(self):
        raise ZeroDivisionError("on purpose")


def test_an_exception_in_a_plugin_stops_the_server_loudly_by_default(arm_world, caplog):
    arm_world.add(Fragile, "fragile")
    arm_world.loop.step(100)
    assert arm_world.simulation.step == 5
    assert isinstance(arm_world.loop.failure, MjplugError)
    assert "plugin fragile failed: ZeroDivisionError('on purpose')" in str(arm_world.loop.failure)
    assert caplog.records[0].exc_info


def test_with_the_disable_policy_the_plugin_is_switched_off_and_the_rest_continues(arm_world, caplog):
    plugin = Fragile()
    host = arm_world.host("fragile", disable_on_error=True)
    host.attach(plugin)
    plugin.init(host, Parameters())
    arm_world.loop.step(100)
    assert arm_world.simulation.step == 100
    assert arm_world.loop.failure is None
    assert len([r for r in caplog.records if r.levelno == logging.ERROR]) == 1
