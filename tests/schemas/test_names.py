"""ROS name rules and what relative names mean."""

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mjplug_schemas.errors import NameRuleError
from mjplug_schemas.names import (
    dds_type,
    key,
    normalize_namespace,
    resolve,
    validate_name,
    validate_node_name,
    validate_substituted,
)

LETTERS = "use letters of the English alphabet, digits, '_' and '/'"
LETTERS_OF_NODES = "use letters of the English alphabet, digits and '_'"


@pytest.mark.parametrize("name", ["/a", "/robot1/cmd_vel", "/_hidden/a__b", "/A9/z", "/" + "a" * 246])
def test_valid_names_pass(name):
    validate_name(name)


@pytest.mark.parametrize(
    ("name", "rule"),
    [
        ("", "a full name must start with '/'"),
        ("a/b", "a full name must start with '/'"),
        ("/", "a name must not end with '/'"),
        ("/a/", "a name must not end with '/'"),
        ("/a//b", "a name must not contain '//'"),
        ("//a", "a name must not contain '//'"),
        ("/a/9b", "'9b' must not start with a digit"),
        ("/a-b", f"'-' is not allowed; {LETTERS}"),
        ("/a b", f"' ' is not allowed; {LETTERS}"),
        ("/a/@json", f"'@' is not allowed; {LETTERS}"),
        ("/a/*", f"'*' is not allowed; {LETTERS}"),
        ("/a/{node}", f"'{{' is not allowed; {LETTERS}"),
        ("/a/~/b", f"'~' is not allowed; {LETTERS}"),
        ("/é", f"'é' is not allowed; {LETTERS}"),
        ("/a\n", f"'\\n' is not allowed; {LETTERS}"),
    ],
)
def test_a_bad_name_is_refused_with_the_rule_it_breaks(name, rule):
    with pytest.raises(NameRuleError) as caught:
        validate_name(name)
    assert str(caught.value) == f"{name!r} is not a valid ROS name: {rule}"


def test_a_name_has_at_most_247_characters():
    with pytest.raises(NameRuleError) as caught:
        validate_name("/" + "a" * 247)
    shown = "/" + "a" * 76 + "…"
    assert str(caught.value) == (f"'{shown}' is not a valid ROS name: it has 248 characters; at most 247 are allowed")


@given(name=st.text("/ab9_-~\n", max_size=8))
def test_exactly_the_names_of_the_grammar_are_valid(name):
    valid = re.fullmatch(r"(/[A-Za-z_][A-Za-z0-9_]*)+", name) is not None
    try:
        validate_name(name)
    except NameRuleError:
        assert not valid
    else:
        assert valid


@pytest.mark.parametrize(
    ("name", "rule"),
    [
        ("", "it must not be empty"),
        ("a/b", "it must not contain '/'; set the namespace separately"),
        ("1st", "'1st' must not start with a digit"),
        ("my-node", f"'-' is not allowed; {LETTERS_OF_NODES}"),
    ],
)
def test_a_bad_node_name_is_refused_with_the_rule_it_breaks(name, rule):
    validate_node_name("mjplug_1")
    with pytest.raises(NameRuleError) as caught:
        validate_node_name(name)
    assert str(caught.value) == f"{name!r} is not a valid ROS node name: {rule}"


@pytest.mark.parametrize(
    ("namespace", "full"), [("", ""), ("/", ""), ("robot1", "/robot1"), ("/robot1", "/robot1"), ("a/b", "/a/b")]
)
def test_a_namespace_may_leave_out_its_first_slash(namespace, full):
    assert normalize_namespace(namespace) == full


@pytest.mark.parametrize("namespace", ["a/", "//", "/a//b", "9", "a b"])
def test_a_bad_namespace_is_refused(namespace):
    with pytest.raises(NameRuleError, match=f"^{re.escape(repr(namespace))} is not a valid ROS namespace: "):
        normalize_namespace(namespace)


@pytest.mark.parametrize(
    ("name", "namespace", "full"),
    [
        ("/clock", "robot1", "/clock"),
        ("apply_wrench", "", "/external_wrench/apply_wrench"),
        ("~/apply_wrench", "", "/external_wrench/apply_wrench"),
        ("apply_wrench", "/robot1", "/robot1/external_wrench/apply_wrench"),
        ("~/a/b", "robot1/arm", "/robot1/arm/external_wrench/a/b"),
    ],
)
def test_relative_names_live_under_namespace_and_instance(name, namespace, full):
    assert resolve(name, namespace=namespace, node="external_wrench") == full


def test_remapping_takes_the_resolved_name_once():
    remap = {"/lidar/scan": "/robot1/scan", "/robot1/scan": "/elsewhere"}
    assert resolve("scan", node="lidar", remap=remap) == "/robot1/scan"
    assert resolve("/robot1/scan", node="lidar", remap=remap) == "/elsewhere"
    assert resolve("/scan", node="lidar", remap=remap) == "/scan"


@pytest.mark.parametrize(
    ("name", "sentence"),
    [
        ("", "'' is not a valid ROS name: it must not be empty"),
        ("~", "'~' is not a valid ROS name: '~' is allowed only at the start, followed by '/' and a name"),
        ("~a", "'~a' is not a valid ROS name: '~' is allowed only at the start, followed by '/' and a name"),
        ("~/", "'~/' is not a valid ROS name: a name must not end with '/'"),
        ("~//a", "'~//a' is not a valid ROS name: a name must not contain '//'"),
        ("a-b", f"'/node/a-b' is not a valid ROS name: '-' is not allowed; {LETTERS}"),
        ("/moved", "'nowhere' is not a valid ROS name: a full name must start with '/'"),
    ],
)
def test_what_cannot_be_resolved_is_refused(name, sentence):
    with pytest.raises(NameRuleError) as caught:
        resolve(name, node="node", remap={"/moved": "nowhere"})
    assert str(caught.value) == sentence


def test_a_bad_instance_name_is_refused():
    with pytest.raises(NameRuleError, match=r"^'my plugin' is not a valid ROS node name: "):
        resolve("a", node="my plugin")


def test_a_key_is_the_name_without_its_first_slash():
    assert key("/robot1/cmd_vel") == "robot1/cmd_vel"


def test_dds_names_of_types():
    assert dds_type("std_msgs/msg/String") == "std_msgs::msg::dds_::String_"
    assert dds_type("std_srvs/srv/Trigger") == "std_srvs::srv::dds_::Trigger_"


@pytest.mark.parametrize(
    ("namespace", "full"), [("", "/scan"), ("/", "/scan"), ("r1", "/r1/scan"), ("/a/b", "/a/b/scan")]
)
def test_a_name_with_the_namespace_substituted_is_below_the_namespace_and_not_the_node(namespace, full):
    assert resolve("{ns}/scan", namespace=namespace, node="lidar") == full


@pytest.mark.parametrize(
    "name", ["a{ns}/scan", "{node}/scan", "{ns}scan", "{namespace}/scan", "{ns}", "{ns}/", "{ns}//a", "{ns}/{ns}/a"]
)
def test_a_substitution_anywhere_else_is_refused(name):
    with pytest.raises(NameRuleError, match="is not a valid ROS name"):
        resolve(name, namespace="r1", node="lidar")


def test_remapping_substitutes_the_namespace_on_both_sides():
    remap = {"/clock": "{ns}/clock", "{ns}/scan": "{ns}/front/scan"}
    names = [
        resolve(name, namespace="r1", node="n", remap=remap) for name in ("/clock", "/r1/scan", "{ns}/scan", "/scan")
    ]
    assert names == ["/r1/clock", "/r1/front/scan", "/r1/front/scan", "/scan"]


def test_a_name_with_a_substitution_is_checked_without_a_namespace():
    validate_substituted("{ns}/scan")
    validate_substituted("/scan")
    for name in ("scan", "{ns}scan", "{ns}", "{ns}/9a"):
        with pytest.raises(NameRuleError):
            validate_substituted(name)
