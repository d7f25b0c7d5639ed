"""Zenoh configurations: a user's file, with mjplug's default for shared memory where the file does not set it."""

import re
from pathlib import Path

import zenoh

SHARED_MEMORY = "transport/shared_memory/enabled"
"""Off unless the user's file contains the section `shared_memory`.

With shared memory on, as is Zenoh's default, a process keeps 16 MiB mapped for every peer that ever sent it more than
3 kB, and never unmaps them. A /dev/shm of 64 MiB, which containers have, is full after four clients.
"""

_SECTION = re.compile(r"""(?<![\w-])["']?shared_memory["']?\s*:""")
_COMMENTS = re.compile(r"""("(?:\\.|[^"\\])*"|'(?:\\.|[^'\\])*')|//[^\n]*|/\*.*?\*/|(?<!\S)\#[^\n]*""", re.DOTALL)


def read(path: str | Path | None) -> zenoh.Config:
    """Returns the configuration of a file (JSON5, JSON or YAML), or Zenoh's defaults without one.

    Raises:
        zenoh.ZError: The file cannot be read, or has a setting that Zenoh does not know.
    """
    config = zenoh.Config() if path is None else zenoh.Config.from_file(path)
    if path is None or not _sets_shared_memory(Path(path)):
        config.insert_json5(SHARED_MEMORY, "false")
    return config


def _sets_shared_memory(path: Path) -> bool:
    # A parsed configuration does not show which values come from the file: Zenoh's default is `true` too.
    text = path.read_text(encoding="utf-8", errors="replace")
    return _SECTION.search(_COMMENTS.sub(lambda match: match[1] or " ", text)) is not None
