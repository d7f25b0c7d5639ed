"""Nothing that a user can set, call or hear is missing in the docs, and nothing is in the docs that is not there."""

import inspect
import re
from typing import Literal, get_args, get_origin

import mujoco
import pytest
import typer
from docs.markdown import PAGES, ROOT, anchors, links, prose, rows, section
from docs.terminal import matches
from pydantic import BaseModel
from pydantic_core import PydanticUndefined

import mjplug.client
import mjplug.plugin
import mjplug.testing
from mjplug.cli.app import app
from mjplug.cli.exit_codes import EXIT_CODES, EXIT_CODES_OF_COMMANDS
from mjplug.config.document import unquoted
from mjplug.config.settings import PluginEntry, Settings
from mjplug.model.location import SUFFIXES, bundled_models
from mjplug.physics.simulation import Simulation
from mjplug.plugin import Host, Plugin, registry
from mjplug.plugin.node_view import NodeView
from mjplug.plugin.selection import Selected
from mjplug.plugin.world_view import WorldView
from mjplug.server.offline import OfflineWorkerPool
from mjplug.server.server import Server
from mjplug.testing import FakeTransport
from mjplug.wire.calls import MAX_OPEN_CALLS
from mjplug.wire.encoding import MAX_JSON, MAX_PAYLOAD

CONFIGURATION, WIRE, PLUGINS, CLI, CLIENT = "configuration.md", "wire.md", "plugins.md", "cli.md", "client.md"
TESTING = "testing.md"

SETTINGS = rows(section(CONFIGURATION, "Settings").partition("### ")[0])

# `registry.find` reads the entry points of all packages each time.
NAMES = {name: point.load() for name, point in registry.registered().items()}
CLASSES = set(NAMES.values())


def as_yaml(value):
    """Returns a default as a table shows it."""
    if value is PydanticUndefined:
        return "required"
    if value is None:
        return "none"
    if isinstance(value, bool):
        return f"`{str(value).lower()}`"
    if isinstance(value, tuple) and value:
        return f"`{list(value)}`"
    return f"`{value}`" if value not in ("", (), {}) else {str: '`""`', tuple: "`[]`", dict: "`{}`"}[type(value)]


def words_of(annotation):
    """Yields the words that an annotation allows."""
    if get_origin(annotation) is Literal:
        yield from get_args(annotation)
    else:
        for inner in get_args(annotation):
            yield from words_of(inner)


def leaves(model, prefix=""):
    for name, field in model.model_fields.items():
        if isinstance(field.annotation, type) and issubclass(field.annotation, BaseModel):
            yield from leaves(field.annotation, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", field


def test_every_setting_has_a_row_with_its_default_and_there_are_no_others():
    assert {name: row[1] for name, row in SETTINGS.items()} == {
        name: as_yaml(field.default) for name, field in leaves(Settings)
    }


def test_the_allowed_words_of_a_setting_are_in_its_row():
    for name, field in leaves(Settings):
        for word in words_of(field.annotation):
            assert f"`{word}`" in SETTINGS[name][0], f"{name} can be {word}"


def test_every_key_of_a_plugin_entry_is_described():
    described = section(CONFIGURATION, "Plugins")
    assert {name for name in PluginEntry.model_fields if f"`{name}`" in described} == set(PluginEntry.model_fields)


@pytest.mark.parametrize("plugin_class", sorted(CLASSES, key=lambda c: c.__name__), ids=lambda c: c.__name__)
def test_every_plugin_has_a_section_with_its_names_and_parameters(plugin_class):
    text = section(PLUGINS, plugin_class.__name__)
    table = rows(text)
    names = {name for name, found in NAMES.items() if found is plugin_class}
    (types,) = re.findall(r"^Type: (.*)\.$", text, re.MULTILINE)
    assert set(re.findall(r"`([^`]+)`", types)) == names
    fields = plugin_class.parameters_type.model_fields
    assert set(fields) <= set(table)
    for name, field in fields.items():
        _, default, meaning = table[name]
        assert default == as_yaml(field.default)
        assert meaning == field.description


def test_every_topic_and_service_is_in_a_table_with_its_type():
    transport = FakeTransport()
    body = "<body name='box'><freejoint/><geom size='.1'/></body>"
    model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{body}</worldbody></mujoco>")
    box = str(ROOT / "mjplug" / "bundled" / "box.xml")
    required = {"BaseVelocity": {"body": "box"}, "RobotDescription": {"file": box}}
    selected = [Selected(c.__name__, c, c.parameters_type(**required.get(c.__name__, {}))) for c in CLASSES]
    Server(Settings(model="?"), Simulation(model), transport, selected, OfflineWorkerPool()).cleanup()
    assert len(transport.types) >= 9
    own = rows(section(WIRE, "Names of the server"))
    described = section(PLUGINS, "Services of the server")
    for name, interface in transport.types.items():
        if "/_action/" in name:
            # The services and topics of every action are described together.
            continue
        first, _, rest = name.removeprefix("/").partition("/")
        instance = next((c for c in CLASSES if c.__name__ == first), None)
        if first == "mjplug":
            assert own[f"~/{rest}"][0] == f"`{interface.TYPE}`"
            if name in transport.services:
                assert f"`~/{rest}`, `{interface.__name__}`:" in described
        elif instance:
            assert rows(section(PLUGINS, first))[f"~/{rest}"][0] == f"`{interface.TYPE}`"
        else:
            absolute = dict(own)
            for plugin_class in CLASSES:
                absolute |= rows(section(PLUGINS, plugin_class.__name__))
            absolute = {documented.replace("{ns}", ""): row for documented, row in absolute.items()}
            assert absolute[name][0] == f"`{interface.TYPE}`"


def serve_command():
    command = typer.main.get_command(app)
    return command.commands["serve"]


def commands(group=None, words=()):
    """Yields every command with its name."""
    for name, command in (group or typer.main.get_command(app)).commands.items():
        if hasattr(command, "commands"):
            yield from commands(command, (*words, name))
        else:
            yield " ".join((*words, name)), command


def flags_of(command):
    options = [flag for parameter in command.params for flag in (*parameter.opts, *parameter.secondary_opts)]
    return {flag for flag in options if flag.startswith("-")} | {"--help", "-h"}


def test_every_flag_of_serve_has_a_row_and_there_are_no_others():
    flags = {flag for parameter in serve_command().params for flag in parameter.opts if flag.startswith("-")}
    documented = rows(section(CONFIGURATION, "The command line"))
    assert {name for name in documented if name.startswith("-")} == flags | {"--help", "-h"}


OF_DOCKER = {"--env", "--gpus", "--health-cmd", "--no-healthcheck", "--publish"}


def test_every_flag_that_a_page_mentions_is_there():
    flags = {flag for _, command in commands() for flag in flags_of(command)} | {"--version"} | OF_DOCKER
    for page in PAGES:
        mentioned = set(re.findall(r"(?<![\w-])--[a-z][a-z-]*", prose(page)))
        assert mentioned <= flags, page


SHARED = rows(section(CLI, "Options that are always the same"))


@pytest.mark.parametrize("name", [name for name, _ in commands() if name != "serve"])
def test_every_command_has_a_section_with_its_arguments_and_flags(name):
    command = dict(commands())[name]
    text = section(CLI, name)
    table = rows(text)
    shared = set(SHARED) if set(SHARED) <= flags_of(command) else {"--help", "-h"}
    # `record` has a short flag of its own that is shared elsewhere.
    own = {f for p in command.params if p.opts[0] not in shared for f in (*p.opts, *p.secondary_opts) if f[0] == "-"}
    assert {flag for flag in table if flag.startswith("-")} == own
    assert f"`mjplug {name}" in text
    for parameter in command.params:
        if not parameter.opts[0].startswith("-"):
            assert parameter.metavar in re.search(rf"`mjplug {name}([^`]*)`", text)[1]


def test_a_command_that_talks_to_a_server_has_the_options_for_it():
    for name, command in commands():
        if name.split()[0] in (
            "topic",
            "service",
            "action",
            "node",
            "param",
            "sim",
            "top",
            "teleop",
            "record",
            "foxglove",
        ):
            assert set(SHARED) <= flags_of(command), name


def test_exit_codes_are_those_of_the_command_line():
    documented = {int(code) for code in rows(section(CLI, "Exit codes")) if code.isdecimal()}
    assert documented == EXIT_CODES_OF_COMMANDS
    assert documented >= {code for _, code in EXIT_CODES}
    in_help = re.findall(r"(\d+) ", app.info.epilog.partition("Exit codes: ")[2])
    assert {int(code) for code in in_help} == EXIT_CODES_OF_COMMANDS


def test_everything_in_the_client_is_described():
    text = prose(CLIENT)
    for name in mjplug.client.__all__:
        assert re.search(rf"`{name}\b[^`]*`", text), name
    kinds = (
        mjplug.client.Client,
        mjplug.client.Subscription,
        mjplug.client.Goal,
        mjplug.client.Publisher,
        mjplug.RunningServer,
    )
    for kind in kinds:
        table = rows(section(CLIENT, kind.__name__))
        for name, expected, documented in signatures(kind, table):
            # Only the client calls it.
            internal = (kind.__name__, name) in (("Subscription", "open"), ("Goal", "send"))
            assert internal or documented == expected
        assert {name for name, member in inspect.getmembers(kind) if isinstance(member, property)} <= set(table)


def test_everything_of_the_test_kit_is_described():
    text = prose(TESTING)
    for name in mjplug.testing.__all__:
        assert re.search(rf"`{name}\b[^`]*`", text), name
    table = rows(section(TESTING, "World"))
    for _, expected, documented in signatures(mjplug.testing.World, table):
        assert documented == expected
    assert set(inspect.signature(mjplug.testing.World).parameters) == set(
        re.search(r"`World\(([^)]*)\)`", text)[1].split(", ")
    )


def test_every_argument_of_open_server_is_described():
    described = set(rows(section(CLIENT, "open_server")))
    assert {"config", *described} == set(inspect.signature(mjplug.open_server).parameters)


def test_bundled_models_are_listed_with_their_keyframes():
    table = rows(section(CONFIGURATION, "Models"))
    assert {name for name in table if name.startswith("bundled:") and name != "bundled:NAME"} == {
        f"bundled:{name}" for name in bundled_models()
    }
    for name in bundled_models():
        model = mujoco.MjModel.from_xml_path(str(ROOT / "mjplug" / "bundled" / f"{name}.xml"))
        keyframes = [model.key(i).name for i in range(model.nkey)]
        assert re.findall(r"`(\w+)`", table[f"bundled:{name}"][1]) == keyframes


def test_every_ending_of_a_model_file_is_named():
    text = section(CONFIGURATION, "Models")
    assert all(f"`{suffix}`" in text for suffix in SUFFIXES)


def test_scalars_have_the_meanings_in_the_table():
    expected = {"true": True, "false": False, "infinity": float("inf"), "nothing": None}
    checked = 0
    for line in section(CONFIGURATION, "Scalars").splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if len(cells) != 2:
            continue
        texts, meaning = cells
        for text in re.findall(r"`([^`]+)`", texts):
            value = text if meaning == "the text" else expected.get(meaning, meaning)
            got = unquoted(text)
            assert got == value or repr(got) == value, text
            checked += 1
    assert checked == 18


def signatures(kind, table):
    """Yields each public method of a class with the arguments that the docs give it."""
    documented = {name.partition("(")[0]: name for name in table if "(" in name}
    for name, member in inspect.getmembers(kind):
        if not name.startswith("_") and inspect.isfunction(member):
            parameters = [p for p in inspect.signature(member).parameters if p != "self"]
            yield name, f"{name}({', '.join(parameters)})", documented.get(name)


def test_every_method_of_the_host_is_described_with_its_arguments():
    table = rows(section(PLUGINS, "The host"))
    for name, expected, documented in signatures(Host, table):
        # Only the server calls it.
        assert name == "attach" or documented == expected
    properties = {name for name, member in inspect.getmembers(Host) if isinstance(member, property)}
    assert properties <= set(table)
    instance = re.findall(
        r"^        self\.([a-z]\w*)\b",
        "".join(inspect.getsource(kind.__init__) for kind in (WorldView, NodeView, Host)),
        re.MULTILINE,
    )
    assert {*instance} <= set(table)
    assert set(table) <= {*instance, *properties, *(expected for _, expected, _ in signatures(Host, table))}


def test_every_method_of_a_plugin_is_described_with_its_arguments():
    table = rows(section(PLUGINS, "The class"))
    for _, expected, documented in signatures(Plugin, table):
        assert documented == expected


def test_everything_in_the_plugin_api_is_described():
    text = section(PLUGINS, "Writing a plugin")
    for name in mjplug.plugin.__all__:
        assert re.search(rf"`{name}\b[^`]*`", text), name


def test_limits_are_those_of_the_code():
    text = section(WIRE, "Limits")
    assert f"{MAX_PAYLOAD} bytes" in text
    assert f"{MAX_JSON} bytes" in text
    assert text.count(str(MAX_OPEN_CALLS)) == 2


@pytest.mark.parametrize("page", [page for page in PAGES if page != "README.md"])
def test_every_page_is_reached_from_the_readme(page):
    assert f"docs/{page}" in links("README.md")


@pytest.mark.parametrize("page", PAGES)
def test_every_link_leads_somewhere(page):
    for link in links(page):
        if link.startswith("https://"):
            continue
        path, _, anchor = link.partition("#")
        target = (PAGES[page].parent / path).resolve() if path else PAGES[page]
        # The last page is written by `make bench`.
        assert target.exists() or target.name == "benchmarks.md", link
        if anchor:
            assert anchor in anchors(target.name), link


@pytest.mark.parametrize(
    ("expected", "same"),
    [
        ("one\ntwo 2\n", True),
        ("one\ntwo ...\n", True),
        ("...\ntwo 2\n", True),
        ("...\n", True),
        ("one\n", False),
        ("two 2\n", False),
        ("one\ntwo .\n", False),
        ("one ... three\n", False),
    ],
)
def test_an_output_matches_only_what_it_shows(expected, same):
    assert matches("one  \ntwo 2\n", expected) is same
