"""Builds the documentation as a site that loads nothing from elsewhere.

Usage: python docs/site/build.py [FOLDER]      (default build; the site is in FOLDER/site)

The pages are written to be read in the repository too. So they are copied with their links changed: examples become
pages of the site, and plugins.md, which is one page for those who search in it, becomes one page for each plugin.
"""

import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import yaml

ROOT = Path(__file__).parents[2]

LINK = re.compile(r"\]\((?!https?:)([^)#\s]*)(#[^)\s]*)?\)")
INFO = re.compile(r"( *```\w+) (.+)")
SOURCE = re.compile(
    r"\[([^\]]+)\]\((?:\.\./)+((?:tests|benchmarks|bridge_ros2|msgs_ros2|mjplug|plugins|schemas)(?:/[\w./-]*)?)\)"
)
FENCE = re.compile(r"^( *```.*?^ *```)$", re.MULTILINE | re.DOTALL)


def main() -> int:
    """Writes the pages and builds the site; returns the generator's exit code."""
    build = Path(sys.argv[1] if len(sys.argv) > 1 else ROOT / "build").resolve()
    for folder in ("pages", "site"):
        shutil.rmtree(build / folder, ignore_errors=True)
    config = write_pages(build / "pages")
    (build / "mkdocs.yml").write_text(yaml.safe_dump(config, sort_keys=False), encoding="utf-8")
    # A broken link is a warning, and a warning is an error.
    command = [Path(sys.executable).parent / "zensical", "build", "--clean", "--strict", "-f", build / "mkdocs.yml"]
    return subprocess.run(command, env=os.environ | {"NO_COLOR": "1"}, check=False).returncode


def write_pages(folder: Path) -> dict[str, Any]:
    """Writes all pages of the site into a folder; returns the generator's configuration."""
    parts = split(ROOT / "docs" / "plugins.md")
    for page in (ROOT / "docs").glob("*.md"):
        if page.name != "plugins.md":
            write(folder, page.name, page.read_text(encoding="utf-8"), parts)
    for path, text in parts.pages.items():
        write(folder, path, text, parts)
    shutil.copytree(ROOT / "docs" / "pictures", folder / "pictures")
    examples = sorted((ROOT / "examples").glob("*/README.md"))
    for readme in examples:
        write(folder, f"examples/{readme.parent.name}/index.md", readme.read_text(encoding="utf-8"), parts)
        for picture in [*readme.parent.glob("*.jpg"), *readme.parent.glob("*.png")]:
            shutil.copy(picture, folder / "examples" / readme.parent.name)
    config = yaml.safe_load((ROOT / "docs" / "site" / "mkdocs.yml").read_text(encoding="utf-8"))
    extend(config, "Examples", [f"examples/{readme.parent.name}/index.md" for readme in examples])
    extend(config, "Plugins", [path for path in parts.pages if path != "plugins.md"])
    config["theme"]["custom_dir"] = str(ROOT / "docs" / "site" / "theme")
    if address := repository():
        config |= {"repo_url": address, "repo_name": "Source code"}
    return config


def repository() -> str:
    """Returns the web address of the repository.

    It is `project.urls.Repository` of pyproject.toml, otherwise that of the remote `origin`; empty if neither has one.
    """
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    if address := project.get("urls", {}).get("Repository"):
        return str(address)
    if shutil.which("git") is None:
        return ""
    command = ["git", "-C", ROOT, "config", "--get", "remote.origin.url"]
    return web_address(subprocess.run(command, capture_output=True, text=True, check=False).stdout.strip())


def web_address(remote: str) -> str:
    """Returns the web address of a Git remote, without user and password; empty if it has none, such as a folder."""
    if short := re.fullmatch(r"[\w.-]+@([\w.-]+):(?!//)(.+)", remote):
        remote = f"ssh://{short[1]}/{short[2]}"
    parts = urlsplit(remote)
    if parts.scheme not in ("https", "http", "ssh") or not parts.hostname:
        return ""
    # The port is that of SSH, or one at which a browser is answered too.
    port = f":{parts.port}" if parts.port and parts.scheme != "ssh" else ""
    scheme = "http" if parts.scheme == "http" else "https"
    return f"{scheme}://{parts.hostname}{port}{parts.path.rstrip('/').removesuffix('.git')}"


def extend(config: dict[str, Any], section: str, pages: list[str]) -> None:
    """Adds pages to a section of the navigation."""
    next(entry[section] for entry in config["nav"] if section in entry).extend(pages)


class Parts:
    """A page that has been split at its second-level headings.

    Attributes:
        pages: The texts, by path on the site.
        places: Where the headings of the original page are now, by anchor.
    """

    def __init__(self) -> None:
        self.pages: dict[str, str] = {}
        self.places: dict[str, str] = {}

    def add(self, path: str, text: str) -> None:
        """Adds a page, and notes the anchors in it."""
        self.pages[path] = text
        for heading in re.findall(r"^#+ (.*)$", FENCE.sub("", text), re.MULTILINE):
            self.places[anchor(heading)] = path


def split(page: Path) -> Parts:
    """Splits the page of all plugins."""
    parts = Parts()
    # Headings inside of code are comments.
    pieces = re.split(r"^## (?=.*\n\n)", page.read_text(encoding="utf-8"), flags=re.MULTILINE)
    head, *sections = pieces
    listing = "".join(f"- [{s.partition(chr(10))[0]}](#{anchor(s.partition(chr(10))[0])})\n" for s in sections)
    parts.add("plugins.md", f"{head}\n{listing}")
    for section in sections:
        title, _, body = section.partition("\n")
        body = re.sub(r"^##(#+ )", r"#\1", body, flags=re.MULTILINE)
        parts.add(f"plugins/{anchor(title)}.md", f"# {title}\n{body}")
    return parts


def anchor(heading: str) -> str:
    """Returns the anchor of a heading."""
    return re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")


def titled(fence: re.Match[str]) -> str:
    """Returns the first line of a fence, with the name of the file that it shows as its title."""
    name = fence[2].rpartition(" ")[2]
    return f'{fence[1]} title="{name}"' if "." in name else fence[1]


def write(folder: Path, path: str, text: str, parts: Parts) -> None:
    """Writes a page of the site, with its links changed."""
    up = "../" * path.count("/")

    def changed(found: re.Match[str]) -> str:
        target, fragment = found[1], found[2] or ""
        name = target.rpartition("docs/")[2] if "docs/" in target else target
        if (name == "plugins.md" or (not name and path in parts.pages)) and fragment:
            return f"]({up}{parts.places[fragment[1:]]}{fragment})"
        if example := re.fullmatch(r"\.\./examples(/\w+)?", target):
            return f"]({up}examples{f'{example[1]}/index.md' if example[1] else '.md'})"
        if name.endswith(".md") or name.startswith("pictures/"):
            return f"]({up}{name}{fragment})"
        return found[0]

    # What stands in fences is left alone; but of what stands behind the language, the generator knows titles only.
    pieces = FENCE.split(text)
    pieces[::2] = [SOURCE.sub(r"\1 (`\2`)", LINK.sub(changed, piece)) for piece in pieces[::2]]
    pieces[1::2] = [INFO.sub(titled, piece, count=1) for piece in pieces[1::2]]
    file = folder / path
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text("".join(pieces), encoding="utf-8")


if __name__ == "__main__":
    sys.exit(main())
