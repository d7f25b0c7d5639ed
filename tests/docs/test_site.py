"""The site is built without a warning, holds every page, and loads nothing from elsewhere."""

import importlib.util
import os
import re
import shutil
import subprocess
import sys
from html.parser import HTMLParser

import pytest
import yaml
from docs.markdown import PAGES, ROOT, prose

SITE = ROOT / "docs" / "site"

# A clone with a password in its address, of a private repository.
ORIGIN = {
    "GIT_CONFIG_COUNT": "1",
    "GIT_CONFIG_KEY_0": "remote.origin.url",
    "GIT_CONFIG_VALUE_0": "https://robin:hood@git.test/robots/mjplug.git",
}


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
    """Builds the site; returns its folder and the output."""
    folder = tmp_path_factory.mktemp("site")
    done = subprocess.run(
        [sys.executable, SITE / "build.py", folder],
        env=os.environ | ORIGIN,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
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


@pytest.mark.skipif(shutil.which("git") is None, reason="this machine has no git")
def test_every_page_links_to_the_repository_and_asks_its_host_for_nothing(built, pages):
    for name, page in pages.items():
        text = (built / "site" / name).read_text("utf-8")
        assert "https://git.test/robots/mjplug" in page.links, name
        assert "robin:hood" not in text
        # The script of the theme asks the host for stars and versions where it finds this.
        assert 'data-md-component="source"' not in text


@pytest.mark.parametrize(
    ("remote", "address"),
    [
        ("https://git.test/a/b.git", "https://git.test/a/b"),
        ("https://token@git.test:8443/a/b/", "https://git.test:8443/a/b"),
        ("http://git.test/b", "http://git.test/b"),
        ("git@git.test:a/b.git", "https://git.test/a/b"),
        ("ssh://git@git.test:2222/a/b.git", "https://git.test/a/b"),
        ("/srv/git/b.git", ""),
        ("../b", ""),
        ("file:///srv/git/b.git", ""),
        ("", ""),
    ],
)
def test_the_web_address_of_a_remote_has_neither_user_nor_suffix(remote, address):
    spec = importlib.util.spec_from_file_location("site_build", SITE / "build.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    assert module.web_address(remote) == address


def test_every_page_has_light_and_dark_colours_and_follows_the_system(built, pages):
    for name in pages:
        text = (built / "site" / name).read_text("utf-8")
        choices = re.findall(r'data-md-color-media="([^"]*)" data-md-color-scheme="(\w+)"', text)
        assert choices == [
            ("(prefers-color-scheme)", "default"),
            ("(prefers-color-scheme: light)", "default"),
            ("(prefers-color-scheme: dark)", "slate"),
        ], name


@pytest.mark.parametrize("page", PAGES)
def test_no_link_has_the_name_of_a_file_as_its_text(page):
    assert [text for text in re.findall(r"\[([^\]]+)\]\(", prose(page)) if text.endswith(".md")] == []


@pytest.mark.parametrize("page", PAGES)
def test_no_table_has_an_empty_column(page):
    tables = re.findall(r"(?:^\|.*\|\n)+", prose(page) + "\n", re.MULTILINE)
    for table in tables:
        _, _, *lines = ([cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]] for line in table.splitlines())
        assert lines, table
        assert all(any(column) for column in zip(*lines, strict=True)), table
