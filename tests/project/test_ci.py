"""The hosts of repositories run `.ci/run`, under every Python that the project names."""

import json
import os
import re
import tomllib
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
PYTHONS = [found[1] for line in PROJECT["classifiers"] if (found := re.search(r":: Python :: (3\.\d+)$", line))]
GITHUB = yaml.safe_load((ROOT / ".github/workflows/ci.yml").read_text(encoding="utf-8"))
GITLAB = yaml.safe_load((ROOT / ".gitlab-ci.yml").read_text(encoding="utf-8"))
TARGETS = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE))


def test_the_project_names_each_python_from_the_first_that_it_allows():
    minors = [int(version.removeprefix("3.")) for version in PYTHONS]
    assert minors == list(range(minors[0], minors[0] + len(minors)))
    assert PROJECT["requires-python"] == f">={PYTHONS[0]}"


def test_both_hosts_run_the_script_under_every_python():
    test = GITHUB["jobs"]["test"]
    assert test["strategy"]["matrix"]["python"] == PYTHONS
    assert [step["run"] for step in test["steps"] if step.get("run", "").endswith(" .ci/run")]
    assert GITLAB["test"]["parallel"]["matrix"] == [{"PYTHON": PYTHONS}]
    assert GITLAB["test"]["script"] == [".ci/run"]


def test_the_script_can_be_executed():
    assert os.access(ROOT / ".ci" / "run", os.X_OK)


def test_every_target_of_make_that_a_host_uses_exists():
    steps = [step.get("run", "") for job in GITHUB["jobs"].values() for step in job["steps"]]
    used = {command.removeprefix("make ") for command in [*steps, *GITLAB["release"]["script"]] if "make " in command}
    assert used == {"release"} <= TARGETS


def test_each_issue_form_asks_for_something_and_the_bug_report_for_what_is_needed():
    forms = {
        path.stem: yaml.safe_load(path.read_text("utf-8"))
        for path in (ROOT / ".github/ISSUE_TEMPLATE").glob("*.yml")
        if path.stem != "config"
    }
    assert set(forms) == {"bug", "feature"}
    for form in forms.values():
        assert {"name", "description", "body"} <= set(form)
        assert any(field["type"] == "textarea" for field in form["body"])
    assert "mjplug doctor" in json.dumps(forms["bug"])
    assert "mjplug doctor" in (ROOT / ".gitlab/issue_templates/Bug.md").read_text("utf-8")


@pytest.mark.parametrize("name", ["CONTRIBUTING.md", "SECURITY.md"])
def test_the_commands_and_files_that_contributors_are_told_of_exist(name):
    text = (ROOT / name).read_text("utf-8")
    for target in re.findall(r"`make ([a-z-]+)", text):
        assert target in TARGETS
    for link in re.findall(r"\]\((?!https?:)([^)#\s]+)", text):
        assert (ROOT / link).exists(), link
