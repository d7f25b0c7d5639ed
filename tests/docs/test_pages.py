"""Every page and example is linked, and messages quoted in the pages exist in the code."""

import re

import pytest
from docs.markdown import PAGES, ROOT, prose, rows

EXAMPLES = sorted(path.name for path in (ROOT / "examples").iterdir() if path.is_dir() and path.name[0].isdigit())

SOURCES = "".join(
    path.read_text(encoding="utf-8")
    for folder in ("mjplug", "plugins", "schemas")
    for path in sorted((ROOT / folder).rglob("*.py"))
)


@pytest.mark.parametrize("example", EXAMPLES)
def test_every_example_is_in_the_readme_and_in_the_docs(example):
    assert f"(examples/{example})" in prose("README.md")
    assert any(f"(../examples/{example})" in prose(page) for page in PAGES if page != "README.md")


def test_every_quoted_message_exists_in_the_code():
    quoted = rows(prose("troubleshooting.md"))
    assert len(quoted) > 30
    assert [text for text in quoted if text not in SOURCES] == []


def test_pictures_are_there_have_a_text_and_are_small():
    pictures = 0
    for page in PAGES:
        for text, file in re.findall(r"!\[([^\]]*)\]\(([^)]+)\)", prose(page)):
            path = PAGES[page].parent / file
            assert path.stat().st_size <= 300_000, file
            assert len(text) > 20, file
            pictures += 1
    assert pictures >= 4
