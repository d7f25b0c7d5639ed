"""The site is built without a warning, holds every page, and loads nothing from elsewhere."""

import re
import subprocess
import sys
from html.parser import HTMLParser

import pytest
import yaml
from docs.markdown import PAGES, ROOT

SITE = ROOT / "docs" / "site"


class Page(HTMLParser):
    """What a page of the site refers to, and what can be referred to in it."""

    def __init__(self, text):
        super().__init__()
        self.links, self.loaded, self.anchors = [], [], {""}
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        attributes = dict(attrs)
        self.anchors |= {attributes[name] for name in ("id", "name") if attributes.get(name)}
        if tag == "a" and attributes.get("href"):
            self.links.append(attributes["href"])
        elif attributes.get("src"):
            self.loaded.append(attributes["src"])
        elif tag == "link" and attributes.get("rel") in ("stylesheet", "icon", "preload", "preconnect"):
            self.loaded.append(attributes["href"])


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """Builds the site; gives its folder and what was said."""
    folder = tmp_path_factory.mktemp("site")
    done = subprocess.run(
        [sys.executable, SITE / "build.py", folder], capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return folder


@pytest.fixture(scope="module")
def pages(built):
    site = built / "site"
    return {path.relative_to(site).as_posix(): Page(path.read_text("utf-8")) for path in site.rglob("*.html")}


def listed(entries):
    """Yields the pages of a navigation."""
    for entry in entries:
        value = next(iter(entry.values())) if isinstance(entry, dict) else entry
        yield from [value] if isinstance(value, str) else listed(value)


def test_every_page_is_in_the_navigation_once():
    navigation = list(listed(yaml.safe_load((SITE / "mkdocs.yml").read_text("utf-8"))["nav"]))
    assert sorted(navigation) == sorted(set(PAGES) - {"README.md"})


def test_every_page_every_plugin_and_every_example_is_on_the_site_and_in_its_navigation(built, pages):
    navigation = list(listed(yaml.safe_load((built / "mkdocs.yml").read_text("utf-8"))["nav"]))
    written = {path.relative_to(built / "pages").as_posix() for path in (built / "pages").rglob("*.md")}
    assert sorted(navigation) == sorted(written)
    assert {path.removesuffix(".md") + ".html" for path in written} == set(pages) - {"404.html"}
    headings = re.findall(r"^## (.*)$", PAGES["plugins.md"].read_text("utf-8"), re.MULTILINE)
    assert len([page for page in written if page.startswith("plugins/")]) == len(headings) > 10
    assert {path.parent.name for path in (ROOT / "examples").glob("*/README.md")} == {
        page.split("/")[1] for page in written if page.startswith("examples/")
    }


def test_no_page_loads_anything_from_elsewhere(pages):
    assert {url for page in pages.values() for url in page.loaded if re.match(r"(\w+:)?//", url)} == set()
    assert all(page.loaded for page in pages.values())


def test_every_link_within_the_site_leads_to_a_page_and_to_a_place_in_it(built, pages):
    checked = 0
    for name, page in pages.items():
        # Its links are relative to wherever it was asked for.
        if name == "404.html":
            continue
        for link in [*page.links, *page.loaded]:
            if re.match(r"https?:", link):
                continue
            path, _, anchor = link.partition("#")
            target = (built / "site" / name).parent.joinpath(path).resolve() if path else built / "site" / name
            assert target.exists(), f"{name}: {link}"
            if target.suffix == ".html" and "__" not in anchor:
                assert anchor in pages[target.relative_to(built / "site").as_posix()].anchors, f"{name}: {link}"
            checked += 1
    assert checked > 500


def test_what_a_block_shows_is_on_the_site_as_it_stands(built):
    text = re.sub(r"<[^>]+>", "", (built / "site" / "security.html").read_text("utf-8"))
    for line in ("server.json5", "guest:look", "-copy_extensions copy -out server.pem"):
        assert line in text
