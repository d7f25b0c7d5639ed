"""What the Dockerfile, compose.yaml and the page on containers name exists: commands, options, files and stages."""

import fnmatch
import json
import re
import shlex
import tomllib

import pytest
import typer.main
import yaml
from docs.markdown import ROOT, blocks_of
from docs.terminal import commands

from mjplug.cli.app import app

DOCKERFILE = re.sub(r"\\\n", " ", (ROOT / "Dockerfile").read_text(encoding="utf-8"))
INSTRUCTIONS = [line.split(maxsplit=1) for line in DOCKERFILE.splitlines() if re.match("[A-Z]+ ", line)]
LAST_STAGE = INSTRUCTIONS[max(i for i, (word, _) in enumerate(INSTRUCTIONS) if word == "FROM") :]
COMPOSE = yaml.safe_load((ROOT / "compose.yaml").read_text(encoding="utf-8"))["services"]["mjplug"]
LINES = [line for block in blocks_of("container.md") if block.language == "console" for line in commands(block.text)]


def of(instruction, among=INSTRUCTIONS):
    return [text for word, text in among if word == instruction]


def parsed(words):
    """Returns what the command line makes of the words behind `mjplug`; wrong ones raise an error."""
    command = typer.main.get_command(app)
    while hasattr(command, "commands"):
        name, *words = words
        command = command.commands[name]
    return command.make_context(name, list(words)).params


def test_the_health_check_is_a_command_of_the_command_line():
    (check,) = of("HEALTHCHECK", LAST_STAGE)
    program, *words = json.loads(check.partition("CMD ")[2])
    assert program == "mjplug"
    assert parsed(words)["quick"] is True


def test_the_image_starts_the_command_of_the_project_as_a_user_without_rights():
    (entry,), (user,) = of("ENTRYPOINT", LAST_STAGE), of("USER", LAST_STAGE)
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert json.loads(entry)[-1] in project["scripts"]
    assert int(user) > 0


def test_every_file_that_is_copied_exists_and_is_sent_to_the_engine():
    rules = (ROOT / ".dockerignore").read_text(encoding="utf-8").splitlines()
    let_in = [rule.removeprefix("!") for rule in rules if rule.startswith("!")]
    sources = [source for line in of("COPY") if "--from" not in line for source in line.split()[:-1]]
    assert {"mjplug", "plugins", "schemas"} <= set(sources)
    for source in sources:
        assert (ROOT / source).exists(), source
        assert any(fnmatch.fnmatch(source, rule) for rule in let_in), source
    assert set(let_in) == set(sources)


def test_every_package_of_the_wheel_is_copied():
    wheel = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["hatch"]["build"]["targets"]
    copied = {line.split()[-1] for line in of("COPY")}
    assert {package.split("/")[0] for package in wheel["wheel"]["packages"]} <= copied


def test_the_development_container_is_a_stage_of_the_dockerfile():
    container = json.loads((ROOT / ".devcontainer" / "devcontainer.json").read_text(encoding="utf-8"))
    stages = {found[1] for text in of("FROM") if (found := re.search(r" AS (\w+)$", text))}
    assert container["build"]["target"] in stages
    assert (ROOT / ".devcontainer" / container["build"]["dockerfile"]).samefile(ROOT / "Dockerfile")
    assert any(f" {container['remoteUser']}" in line for line in of("RUN") if "useradd" in line)


def test_compose_runs_a_command_that_exists_on_a_port_of_this_machine_only():
    program, *words = COMPOSE["command"]
    assert program == "serve"
    (endpoint,) = parsed([program, *words])["listen"]
    (port,) = COMPOSE["ports"]
    assert port.startswith("127.0.0.1:")
    assert {port.rpartition(":")[2], endpoint.rpartition(":")[2], *of("EXPOSE")} == {"7447"}


@pytest.mark.parametrize("line", LINES)
def test_every_command_in_a_container_is_one_of_the_command_line(line):
    _, *words = shlex.split(line.removeprefix("$ "))
    assert words[0] in ("build", "run", "compose")
    if words[0] == "build":
        assert words[1:] == ["--tag", COMPOSE["image"], "."]
    elif "mjplug" in words:
        # The last of them is the image or the program: the service of compose.yaml has its name too.
        at = len(words) - 1 - words[::-1].index("mjplug")
        assert parsed(words[at + 1 :]) is not None
