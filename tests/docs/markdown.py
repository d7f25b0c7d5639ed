"""Reads the documentation: its pages, their fenced blocks, their tables, and where their links go."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGES = {path.name: path for path in [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]}

_FENCE = re.compile(r"(?P<indent> *)(?P<fence>`{3,}|~{3,}) *(?P<info>.*)")
_NAMED = re.compile(r"(?:\w+ )?([\w-]+\.(?:json5|txt))")
_FILE_NAME = re.compile(r"(?:#|<!--) ([\w./-]+\.(?:py|ya?ml|toml|xml|urdf\.xacro|urdf))\b")


@dataclass(frozen=True)
class Block:
    """A fenced block.

    Attributes:
        page: File name of the page.
        line: Line of its fence, from 1.
        language: First word of the fence's info string.
        info: The rest of it, which readers do not see: what a JSON block is.
        text: What stands between the fences.
    """

    page: str
    line: int
    language: str
    info: str
    text: str

    @property
    def name(self) -> str:
        return f"{self.page}:{self.line}"

    @property
    def file(self) -> str | None:
        """The file that the block shows.

        Its first line is a comment that names it, `# robot.yaml`; where comments are not allowed, the info string does.
        """
        found = _FILE_NAME.match(self.text) or _NAMED.fullmatch(self.info)
        return found[1] if found else None


def blocks_of(page: str) -> list[Block]:
    return list(parse(page, PAGES[page].read_text(encoding="utf-8")))


def parse(page: str, text: str) -> Iterator[Block]:
    lines = text.splitlines()
    start, opening = 0, None
    for number, line in enumerate(lines):
        found = _FENCE.fullmatch(line)
        if opening is None and found:
            start, opening = number, found
        elif opening is not None and found and found["fence"] == opening["fence"] and not found["info"]:
            indent = len(opening["indent"])
            inside = "".join(f"{inner[indent:]}\n" for inner in lines[start + 1 : number])
            language, _, info = opening["info"].strip().partition(" ")
            yield Block(page, start + 1, language, info.strip(), inside)
            opening = None
    assert opening is None, f"{page}:{start + 1}: the block has no end"


def prose(page: str) -> str:
    """Returns a page without its fenced blocks."""
    text, lines = PAGES[page].read_text(encoding="utf-8"), []
    inside = False
    for line in text.splitlines():
        if _FENCE.fullmatch(line):
            inside = not inside
        elif not inside:
            lines.append(line)
    return "\n".join(lines)


def section(page: str, heading: str) -> str:
    """Returns the prose below a heading, up to the next one of its level or above."""
    found = re.search(rf"^(#+) {re.escape(heading)}$(?P<rest>.*)", prose(page), re.MULTILINE | re.DOTALL)
    assert found, f"{page} has no heading {heading!r}"
    return re.split(rf"^#{{1,{len(found[1])}}} ", found["rest"], maxsplit=1, flags=re.MULTILINE)[0]


def rows(text: str) -> dict[str, list[str]]:
    """Returns the rows of all tables of a text: what stands in backticks in the first cell, and the other cells."""
    found: dict[str, list[str]] = {}
    for line in text.splitlines():
        if not line.startswith("|"):
            continue
        first, *rest = (cell.strip() for cell in re.split(r"(?<!\\)\|", line.strip())[1:-1])
        for name in re.findall(r"`([^`]+)`", first):
            assert name not in found, f"two rows for {name}"
            found[name] = [cell.replace(r"\|", "|") for cell in rest]
    return found


def anchors(page: str) -> set[str]:
    """Returns the anchors that GitHub gives a page's headings."""
    headings = re.findall(r"^#+ (.*)$", prose(page), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def links(page: str) -> list[str]:
    return re.findall(r"\]\(([^)\s]+)\)", prose(page))
