"""Expressions that choose messages: what they compute, and what they refuse."""

import math

import pytest

from mjplug.cli.message_filter import MessageFilter
from mjplug.client import WrongTypeError
from mjplug_schemas.geometry_msgs import Twist, Vector3
from mjplug_schemas.sensor_msgs import JointState
from mjplug_schemas.std_msgs import Header

TWIST = Twist(linear=Vector3(x=0.5, y=-2.0), angular=Vector3(z=math.nan))
JOINTS = JointState(header=Header(frame_id="base"), name=("elbow", "wrist"), position=(0.25, -1.0))


@pytest.mark.parametrize(
    "text",
    [
        "True", "m.linear.x > 0.4", "m.linear.x == 0.5 and m.linear.y < 0", "not m.linear.z",
        "m.linear.y <= -2 <= m.linear.x", "m.linear.x * 4 + m.linear.y == 0", "m.linear.y // 1.5 == -2.0",
        "-m.linear.y % 1.5 == .5", "abs(m.linear.y) > m.linear.x", "isnan(m.angular.z)",
        "hypot(m.linear.x, m.linear.y) > 2",
        "round(5, -10000000000) == 0", "round(m.linear.x * 0.5, 1) == 0.2",
        "m.linear.x if m.linear.y else False", "round(m.linear.x) == 0",
        " m.linear.x in (0.5, 1)", "max([m.linear.x, 3]) == 3", "m.linear.z == 0 or m.nothing.at.all",
    ],
)  # fmt: skip
def test_an_expression_means_what_it_means_in_python(text):
    assert MessageFilter(text)(TWIST)
    assert not MessageFilter(f"not ({text})")(TWIST)


@pytest.mark.parametrize(
    "text",
    [
        "'wrist' in m.name", "len(m.position) == 2", "m.position[1] == -1", "m.position[-1] < m.position[0]",
        "m.name[0].startswith('el') and m.name[1].upper() == 'WRIST'", "sum(m.position[:1]) == 0.25",
        "any(p < -0.5 for p in m.position)", "all(len(n) == 5 for n in m.name if n)", "m.header.frame_id == 'base'",
        "m.velocity == ()", "not m.effort",
    ],
)  # fmt: skip
def test_lists_and_texts_can_be_looked_into(text):
    assert MessageFilter(text)(JOINTS)


def test_messages_of_types_that_are_not_known_here_are_dictionaries():
    assert MessageFilter("m.value > 1 and m.history[0] == 1")({"value": 2.0, "history": [1.0]})


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("__import__('os').system('true')", r"cannot be called; allowed: abs, all"),
        ("m.__class__", r"no field of a message is called '__class__'"),
        ("().__class__.__bases__", r"no field of a message is called '__(class|bases)__'"),
        ("m.linear.copy()", r"cannot be called"),
        ("open('/etc/passwd')", r"cannot be called"),
        ("eval('1')", r"cannot be called"),
        ("lambda: 1", r"Lambda is not allowed"),
        ("(x := 1)", r"NamedExpr is not allowed"),
        ("[x for x in m.position]", r"ListComp is not allowed"),
        ("f'{m.name}'", r"(JoinedStr|FormattedValue) is not allowed"),
        ("2 ** 99999", r"Pow is not allowed"),
        ("1 << 99999", r"LShift is not allowed"),
        ("max(m.position, key=len)", r"cannot be called"),
        ("max(*m.position)", r"Starred is not allowed"),
        ("import os", r"is not an expression"),
        ("m.x >", r"is not an expression"),
        ("", r"is not an expression"),
        ("m.x == '" + "a" * 1000 + "'", r"has 1009 characters; at most 1000 are allowed"),
        ("(" * 400 + ")" * 400, r"is not an expression"),
        (f"m.name({'-' * 900}1)", r"cannot be called; allowed: abs, all"),
    ],
)  # fmt: skip
def test_what_does_not_compare_or_calculate_is_refused_before_any_message(text, reason):
    with pytest.raises(WrongTypeError, match=reason):
        MessageFilter(text)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("m.positon[0] > 1", r"there is no field 'positon', did you mean 'position'\?; known: header, name, position"),
        ("m.position.x", r"there is no field 'x'; tuple has no fields"),
        ("m.position[7] > 1", r"cannot be evaluated: tuple index out of range"),
        ("m.name > 3", r"cannot be evaluated: '>' not supported"),
        ("m.position[0] / 0", r"cannot be evaluated: float division by zero"),
        ("'a' * 1000000000", r"Mult works on numbers only"),
        ("m.position * 1000000000", r"Mult works on numbers only"),
        ("sum((m.name for n in m.name), ())", r"takes 1 positional argument but 2 were given"),
        ("sum(m.name)", r"unsupported operand"),
        ("'%1000000000d' % 1", r"Mod works on numbers only"),
        ("x > 1", r"unknown name 'x'; the message is called m"),
        ("len", r"unknown name 'len'"),
        ("m.position[0].upper()", r"upper works on strings only"),
        ("any(a + b for a in m.position for b in m.position)", r"only one `for` with one variable is allowed"),
    ],
)  # fmt: skip
def test_what_does_not_fit_the_message_is_a_sentence(text, reason):
    with pytest.raises(WrongTypeError, match=reason):
        MessageFilter(text)(JOINTS)
