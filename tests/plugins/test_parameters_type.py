from typing import Generic, TypeVar

import pytest
from pydantic import Field

from mjplug.plugin import Parameters, Plugin


class Rated(Parameters):
    """Parameters that a base class needs."""

    rate: float = Field(default=10.0, description="How often it works [Hz].")


class Named(Rated):
    """Parameters of a plugin on top of these."""

    label: str = Field(default="", description="What it says.")


R = TypeVar("R", bound=Rated)
T = TypeVar("T")
Other = TypeVar("Other")


class Base(Plugin[R]):
    def init(self, host, parameters):
        pass


class Swapped(Base[R], Generic[T, R]):
    pass


def test_a_plugin_gets_the_parameters_that_it_names():
    class Direct(Plugin[Named]):
        pass

    assert Direct.parameters_type is Named


def test_a_plugin_through_a_generic_base_gets_the_parameters_that_it_names():
    class Mine(Base[Named]):
        pass

    assert Mine.parameters_type is Named
    assert Mine.parameters_type(label="x", rate=2).label == "x"


def test_variables_are_matched_by_place_through_several_generic_bases():
    class Mine(Swapped[int, Named]):
        pass

    class Heir(Mine):
        pass

    assert Mine.parameters_type is Named
    assert Heir.parameters_type is Named


def test_a_mixin_before_the_plugin_changes_nothing():
    class Mixin(Generic[Other]):
        pass

    class Mine(Mixin[str], Base[Named]):
        pass

    assert Mine.parameters_type is Named


def test_a_generic_base_without_an_argument_has_the_parameters_that_its_variable_is_bound_to():
    class Plain(Base):
        pass

    assert Base.parameters_type is Rated
    assert Plain.parameters_type is Rated


def test_a_plugin_without_parameters_has_none():
    class Bare(Plugin):
        pass

    assert Bare.parameters_type is Parameters


@pytest.mark.parametrize("wrong", [int, "Named"], ids=repr)
def test_parameters_that_are_no_such_class_are_refused_where_the_plugin_is_written(wrong):
    with pytest.raises(TypeError, match=r"the type argument of plugin Wrong is .*; it must be a subclass"):

        class Wrong(Plugin[wrong]):
            pass
