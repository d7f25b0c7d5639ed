import math

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from mjplug.config.document import parse_document, read_document, split_lines
from mjplug.config.problem import ConfigError, Source
from mjplug.config.scalar import ros_scalar


def parse(text, name="x.yaml"):
    return parse_document(text, Source(name, split_lines(text)))


def refusal(text):
    with pytest.raises(ConfigError) as caught:
        parse(text)
    return str(caught.value)


def test_values_follow_ros_and_quotes_make_text():
    document = parse("a: 1e3\nb: \"1e3\"\nc: !!str 12\nd: 012\ne: [on, 'on', 1:30]\nf: {g: .5}\non: 1\n1: x\n")
    assert document.value == {
        "a": 1000.0,
        "b": "1e3",
        "c": "12",
        "d": 10,
        "e": [True, "on", "1:30"],
        "f": {"g": 0.5},
        "on": 1,
        "1": "x",
    }
    assert document.problems == []


def test_empty_tilde_and_null_are_none_unless_quoted():
    assert parse("a:\nb: ~\nc: null\nd: 'null'\ne: ''").value == {"a": None, "b": None, "c": None, "d": "null", "e": ""}


def test_a_block_scalar_is_unquoted_to_ros():
    assert parse("a: |-\n  5\nb: |\n  5\nc: >-\n  two\n  words\n").value == {"a": 5, "b": "5\n", "c": "two words"}


def test_comments_alone_are_no_value():
    assert parse("# nothing\n").value is None


def test_every_path_has_the_marks_of_key_and_value():
    document = parse("a:\n  b: [1, {c: 2}]\nd: 'x'\n")

    def marks(*path):
        place = document.places[path]
        return (place.key.line, place.key.column), (place.value.line, place.value.column)

    assert marks() == ((1, 1), (1, 1))
    assert marks("a") == ((1, 1), (2, 3))
    assert marks("a", "b") == ((2, 3), (2, 6))
    assert marks("a", "b", 0) == ((2, 7), (2, 7))
    assert marks("a", "b", 1, "c") == ((2, 11), (2, 14))
    assert document.places["a", "b", 0].plain == "1"
    assert document.places[("d",)].plain is None


def test_anchors_and_merge_keys():
    document = parse("base: &b {x: 1, y: 2}\none: *b\ntwo: {y: 3, <<: *b}\nthree:\n  <<: [{x: 7}, *b]\n  z: 9\n")
    assert document.value == {
        "base": {"x": 1, "y": 2},
        "one": {"x": 1, "y": 2},
        "two": {"x": 1, "y": 3},
        "three": {"x": 7, "y": 2, "z": 9},
    }
    assert document.places["two", "x"].value.line == 1


def test_all_bad_parts_are_reported_and_left_out():
    document = parse("a: 1\nb: !!int '2'\na: 3\n[c]: 4\n<<: 5\n")
    assert document.value == {"a": 1, "b": "2"}
    assert "\n".join(map(str, document.problems)) == (
        "x.yaml:2:4: error: the tag '!!int' is not supported; only !!str is, for text that looks like a number\n"
        "    2 | b: !!int '2'\n"
        "      |    ^\n"
        "x.yaml:3:1: error: duplicate key 'a' (first on line 1)\n"
        "    3 | a: 3\n"
        "      | ^\n"
        "x.yaml:4:1: error: a key must be a name, not a list or a mapping\n"
        "    4 | [c]: 4\n"
        "      | ^\n"
        "x.yaml:5:1: error: `<<` merges a mapping or a list of mappings\n"
        "    5 | <<: 5\n"
        "      | ^"
    )


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "a:\n\tb: 1",
            "x.yaml:2:1: error: YAML syntax: found character that cannot start any token "
            "while scanning for the next token\n"
            "    2 | \tb: 1\n"
            "      | ^ indent with spaces; YAML does not allow tabs",
        ),
        (
            "a: [1,\nb: 2",
            "x.yaml:2:5: error: YAML syntax: did not find expected ',' or ']' "
            "while parsing a flow sequence that starts on line 1\n"
            "    2 | b: 2\n"
            "      |     ^",
        ),
        (
            "a: b: c",
            "x.yaml:1:5: error: YAML syntax: mapping values are not allowed in this context\n"
            "    1 | a: b: c\n"
            "      |     ^ write text that contains ': ' in quotes",
        ),
        (
            "a: *b",
            "x.yaml:1:4: error: YAML syntax: found undefined alias\n"
            "    1 | a: *b\n"
            "      |    ^ write text that begins with '*' in quotes",
        ),
        (
            "a: 1\n---\nb: 2",
            "x.yaml:2:1: error: YAML syntax: a second document begins here; "
            "a configuration file must contain one document\n"
            "    2 | ---\n"
            "      | ^",
        ),
        (
            "é: 1\nb: \x07",
            "x.yaml:2:4: error: YAML syntax: the character U+0007 is not allowed\n"
            "    2 | b: \N{REPLACEMENT CHARACTER}\n"
            "      |    ^",
        ),
        (
            "日: 1\n日本: *c",
            "x.yaml:2:5: error: YAML syntax: found undefined alias\n"
            "    2 | 日本: *c\n"
            "      |       ^ write text that begins with '*' in quotes",
        ),
    ],
)
def test_a_syntax_error_shows_its_line(text, message):
    assert refusal(text) == message


@pytest.mark.parametrize(
    "text", ["[" * 65 + "]" * 65, "[" * 200_000, "- " * 65, "&a [*a]", "&a {<<: *a}", "{a: " * 100_000]
)
def test_absurd_nesting_is_refused(text):
    assert "error: the file is nested deeper than 64 levels" in refusal(text).partition("\n")[0]


def test_sixty_four_levels_are_fine():
    assert parse("[" * 64 + "]" * 64).value is not None


def test_an_alias_bomb_is_refused():
    bomb = "a0: &a0 [x]\n" + "".join(f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]\n" for i in range(1, 12))
    assert refusal(bomb).partition("\n")[0].endswith("more than 100000 values; aliases count each time they are used")


def test_a_merge_bomb_is_refused():
    bomb = "a0: &a0 {x: 1}\n" + "".join(
        f"a{i}: &a{i} {{<<: [{', '.join([f'*a{i - 1}'] * 9)}]}}\n" for i in range(1, 12)
    )
    assert "more than 100000 values" in refusal(bomb)


def test_a_long_line_is_shown_around_the_caret():
    text = "{" + "a: 1, " * 200 + "b: *x}"
    first, shown, caret = refusal(text).splitlines()
    assert first == "x.yaml:1:1205: error: YAML syntax: found undefined alias"
    assert len(shown) < 200
    assert shown[caret.index("^")] == "*"


def read_refusal(path):
    with pytest.raises(ConfigError) as caught:
        read_document(path)
    return str(caught.value)


def test_files_that_are_no_text_are_refused_in_one_sentence(tmp_path):
    path = tmp_path / "f.yaml"
    assert read_refusal(path) == f"{path}: error: no such file"
    assert read_refusal(tmp_path) == f"{tmp_path}: error: is a directory, not a configuration file"
    path.write_bytes(b"a: 1\n\xff\xe9")
    assert read_refusal(path) == f"{path}: error: is not a text file in UTF-8 (byte 5)"
    path.write_bytes(b"\x12\0\0\0mjb")
    assert read_refusal(path) == f"{path}: error: is a binary file, not YAML text"
    path.write_text(" <mujoco/>")
    assert read_refusal(path) == (
        f"{path}: error: is XML, not YAML; the name of a model file must end with .xml or .urdf"
    )
    path.write_bytes(b"#" * (4 << 20) + b"#")
    assert read_refusal(path) == f"{path}: error: is larger than 4 MiB, the maximum size of a configuration file"
    assert read_refusal(tmp_path / ("n" * 300)).endswith("cannot be read: File name too long")
    assert read_refusal(path / "x").endswith("cannot be read: Not a directory")


@pytest.mark.parametrize("data", ["a: é".encode("utf-8-sig"), "a: é".encode("utf-16"), "a: é\r\n".encode()])
def test_editors_of_windows_write_readable_files(tmp_path, data):
    path = tmp_path / "f.yaml"
    path.write_bytes(data)
    assert read_document(path).value == {"a": "é"}


def outcome(read, argument):
    try:
        read(argument)
    except ConfigError as error:
        return str(error)
    return "fine"


plain = st.text(st.sampled_from("0123456789abcdefinxyNOTRU+-._:eE "), min_size=1, max_size=10)


@given(plain)
def test_the_walk_agrees_with_the_scalar_rules(text):
    try:
        node = yaml.compose(text, Loader=yaml.BaseLoader)
    except yaml.YAMLError:
        return
    if not isinstance(node, yaml.ScalarNode) or node.value in ("", "~", "null"):
        return
    expected, value = ros_scalar(node.value), parse(text).value
    assert type(value) is type(expected)
    assert value == expected or (math.isnan(value) and math.isnan(expected))
    assert parse(f'"{node.value}"').value == node.value
    assert parse(f"!!str {text}").value == node.value


@given(st.text() | st.text(st.sampled_from("ab:,[]{}&*!<>|-?'\"%#@~ \n\t\\0.1")))
def test_no_text_raises_anything_but_a_config_error(text):
    assert outcome(parse, text).startswith(("fine", "x.yaml:"))


@given(st.binary(max_size=60))
def test_no_bytes_raise_anything_but_a_config_error(tmp_path_factory, data):
    path = tmp_path_factory.mktemp("bytes") / "f.yaml"
    path.write_bytes(data)
    assert outcome(read_document, path).startswith(("fine", str(path)))
