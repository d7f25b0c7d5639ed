"""Executes every fenced block of the README and the docs; see `docs.markdown` and `docs.terminal` for how."""

import json
import re
import tomllib
from xml.etree import ElementTree

import pytest
import zenoh
from docs.markdown import PAGES, ROOT, Block, blocks_of
from docs.terminal import ENDPOINT, Command, commands, matches
from machine import need_program

from mjplug.config.load import read
from mjplug.config.problem import ConfigError
from mjplug.convert.load import load_model
from mjplug.physics.simulation import Simulation
from mjplug.plugin.registry import GROUP
from mjplug.plugin.selection import select
from mjplug.server.offline import OfflineTransport, OfflineWorkerPool
from mjplug.server.server import Server
from mjplug_schemas import registry

MAKE_TARGETS = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE))


class Story:
    """A block together with the blocks around it that matter."""

    def __init__(self, block: Block, before: list[Block], after: list[Block]) -> None:
        self.block = block
        self.page = block.page
        self.before = before
        follower = after[0] if after else None
        self.output = follower.text if follower and follower.language == "output" else None

    @property
    def server(self) -> str:
        """The command line of the server that a reader has running at this point of the page."""
        lines = [line for block in self.before if block.language == "console" for line in commands(block.text)]
        serving = [line for line in lines if Command.parse(line).serves]
        assert serving, f"{self.block.name} connects to a server, but nothing above starts one"
        return serving[-1]

    def expect(self, printed: str) -> None:
        if self.output is not None:
            assert matches(printed, self.output), f"printed:\n{printed}\nbut the page says:\n{self.output}"


def stories() -> list[Story]:
    told = []
    for page in PAGES:
        blocks = blocks_of(page)
        told += [Story(block, blocks[:i], blocks[i + 1 :]) for i, block in enumerate(blocks)]
    return told


STORIES = stories()


def of(language: str) -> pytest.MarkDecorator:
    # The parameters of the bridge are those of a ROS node: tests/bridge/test_docs.py.
    chosen = [story for story in STORIES if story.block.language == language and story.block.info != "bridge"]
    return pytest.mark.parametrize("story", chosen, ids=[story.block.name for story in chosen])


def test_every_block_is_of_a_kind_that_is_executed_here():
    known = {"python", "yaml", "toml", "json", "text", "console", "output", "bash", "ini", "xml"}
    read_only = {"other-languages.md": {"rust", "c", "javascript"}}
    others = [
        f"{story.block.name}: {story.block.language!r}"
        for story in STORIES
        if story.block.language not in known | read_only.get(story.page, set())
    ]
    assert not others
    assert len(STORIES) > 40


def test_every_output_follows_what_printed_it():
    for story in STORIES:
        if story.block.language == "output":
            assert story.before, story.block.name
            assert story.before[-1].language in ("python", "console"), story.block.name


@of("python")
def test_python_blocks_run_and_print_the_documented_output(story, reader_of):
    reader, text = reader_of(story.page), story.block.text
    endpoint = None
    if ENDPOINT in text or "mjplug.client" in text:
        endpoint = reader.server(story.server).endpoint
        text = text.replace(ENDPOINT, endpoint)
    done = reader.script(text, story.block.file or f"line_{story.block.line}.py", endpoint)
    assert done.returncode == 0, done.stdout
    story.expect(done.stdout)


@of("yaml")
def test_a_configuration_starts_a_server_and_a_wrong_one_is_refused(story, reader_of, monkeypatch):
    folder, block = reader_of(story.page).folder, story.block
    path = folder / (block.file or f"line_{block.line}.yaml")
    path.write_text(block.text, encoding="utf-8")
    monkeypatch.syspath_prepend(folder)
    draft = read(path, model=None if "\nmodel:" in f"\n{block.text}" else "bundled:arm", environ={})
    if path.name.startswith("wrong"):
        with pytest.raises(ConfigError):
            select(draft)
        return
    loaded, plugins = select(draft)
    assert not loaded.warnings
    if "type:" in block.text:
        assert plugins
    # Nobody publishes the topic here.
    uri = "bundled:arm" if loaded.settings.model.startswith("topic:") else loaded.settings.model
    model = load_model(uri, folder)
    Server(loaded.settings, Simulation(model.model), OfflineTransport(), plugins, OfflineWorkerPool(), model).cleanup()


@of("json")
def test_json_blocks_are_valid(story):
    kind, text = story.block.info.partition(" ")[0], story.block.text
    json.loads(text)
    if kind == "zenoh":
        assert zenoh.Config.from_json5(text).get_json("mode")
        return
    interface = registry.find(kind)
    assert interface.from_json(text) != interface(), "nothing is set"


@of("text")
def test_a_text_is_a_file_that_other_blocks_need(story):
    assert story.block.file
    assert any(story.block.file in other.text for other in blocks_of(story.page) if other is not story.block)


@of("xml")
def test_a_robot_is_a_file_that_other_blocks_need(story):
    test_a_text_is_a_file_that_other_blocks_need(story)
    ElementTree.fromstring(story.block.text)


@pytest.mark.parametrize("language", ["rust", "c", "javascript"])
def test_programs_in_other_languages_use_the_keys_that_the_program_in_python_uses(language):
    blocks = blocks_of("other-languages.md")
    python = next(block.text for block in blocks if block.language == "python")
    (other,) = (block.text for block in blocks if block.language == language)
    keys = re.findall(r'"(\w+(?:/@?\w+)+)"', other)
    assert "mjplug/set_pause" in keys
    assert all(f'"{key}"' in python for key in keys)


@of("toml")
def test_toml_registers_a_plugin_that_is_on_the_page(story, reader_of, monkeypatch):
    points = tomllib.loads(story.block.text)["project"]["entry-points"][GROUP]
    files = {block.file for block in blocks_of(story.page)}
    for target in points.values():
        module, _, name = target.partition(":")
        assert f"{module}.py" in files
        source = (reader_of(story.page).folder / f"{module}.py").read_text(encoding="utf-8")
        assert f"class {name}(Plugin[" in source


@of("console")
def test_commands_run_and_print_the_documented_output(story, reader_of):
    reader = reader_of(story.page)
    printed, code = "", 0
    lines = commands(story.block.text)
    for line in lines:
        command = Command.parse(line)
        program = command.words[0]
        if line == "$ echo $?":
            printed += f"{code}\n"
            code = 0
            continue
        assert code == 0, f"{story.block.name}: exit code {code}\n{printed}"
        if command.serves:
            printed += reader.server(line).printed
        elif command.shows:
            printed += reader.view(line, reader.server(story.server).endpoint)
        elif program == "mjplug":
            done = reader.run(command, reader.server(story.server).endpoint if command.talks else None)
            printed += done.stdout
            code = done.returncode
        elif program == "make":
            assert set(command.words[1:]) <= MAKE_TARGETS, line
        elif program == "python":
            # Examples are run by tests/examples.
            assert (ROOT / command.words[1]).exists(), line
        elif program == "pytest":
            done = reader.tests(command.words[1:])
            printed += done.stdout
            code = done.returncode
        elif program in ("pip", "git"):
            need_program(program, {"pip": "python3-pip"}.get(program, program))
            assert story.output is None
        elif program == "docker":
            # test_container.py checks them; few machines that run tests have an engine.
            assert story.page == "container.md"
        else:
            raise AssertionError(f"{story.block.name}: nobody here runs {program!r}")
    assert code == 0, f"{story.block.name}: exit code {code}\n{printed}"
    story.expect(printed)
