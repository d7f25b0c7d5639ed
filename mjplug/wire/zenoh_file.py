"""Zenoh configuration files as mjplug reads them.

File names count from the file, shared memory is off unless the file sets it, and mjplug has settings of its own.
"""

import json
import os
import re
from base64 import b64decode
from pathlib import Path
from typing import Any

import zenoh

SHARED_MEMORY = "transport/shared_memory/enabled"
"""Off unless the user's file contains the section `shared_memory`.

With shared memory on, as is Zenoh's default, a process keeps 16 MiB mapped for every peer that ever sent it more than
3 kB, and never unmaps them. A /dev/shm of 64 MiB, which containers have, is full after four clients.
"""

_SECTION = re.compile(r"""(?<![\w-])["']?shared_memory["']?\s*:""")
_COMMENTS = re.compile(r"""("(?:\\.|[^"\\])*"|'(?:\\.|[^'\\])*')|//[^\n]*|/\*.*?\*/|(?<!\S)\#[^\n]*""", re.DOTALL)

_TLS = "transport/link/tls"

_FILE_NAMES = (
    f"{_TLS}/root_ca_certificate",
    f"{_TLS}/listen_certificate",
    f"{_TLS}/listen_private_key",
    f"{_TLS}/connect_certificate",
    f"{_TLS}/connect_private_key",
    "transport/auth/usrpwd/dictionary_file",
    "transport/auth/pubkey/public_key_file",
    "transport/auth/pubkey/private_key_file",
)
"""The settings of Zenoh that name a file."""


def read_zenoh_file(path: str | os.PathLike[str] | None) -> zenoh.Config:
    """Returns the configuration of a file (JSON5, JSON or YAML), or Zenoh's defaults without one.

    Zenoh looks for the files that it names in the folder where the program was started. Here, the folder of the
    configuration file comes first, so that the program can be started anywhere.

    Raises:
        zenoh.ZError: The file cannot be read, or has a setting that Zenoh does not know.
    """
    if path is None:
        config = zenoh.Config()
        config.insert_json5(SHARED_MEMORY, "false")
        return config
    config = zenoh.Config.from_file(os.fspath(path))
    folder = Path(path).resolve().parent
    for key in _FILE_NAMES:
        name = setting(config, key)
        if isinstance(name, str) and (folder / name).is_file():
            config.insert_json5(key, json.dumps(str(folder / name)))
    if not _sets_shared_memory(Path(path)):
        config.insert_json5(SHARED_MEMORY, "false")
    return config


def _sets_shared_memory(path: Path) -> bool:
    # A parsed configuration does not show which values come from the file: Zenoh's default is `true` too.
    text = path.read_text(encoding="utf-8", errors="replace")
    return _SECTION.search(_COMMENTS.sub(lambda match: match[1] or " ", text)) is not None


def setting(config: zenoh.Config, key: str) -> Any:
    """Returns a setting of a configuration; None where it is not set, or inside of something that is not."""
    try:
        return json.loads(config.get_json(key))
    except (zenoh.ZError, KeyError, ValueError):
        return None


def own_settings(config: zenoh.Config) -> dict[str, Any]:
    """Returns what a file says to mjplug alone, under `metadata: {mjplug: …}`."""
    metadata = setting(config, "metadata")
    own = metadata.get("mjplug") if isinstance(metadata, dict) else None
    return own if isinstance(own, dict) else {}


def certificate(config: zenoh.Config, path: Path, side: str) -> str | None:
    """Returns a program's own certificate as PEM text; None if the configuration names none that can be read.

    Args:
        config: The configuration.
        path: The file it comes from. Zenoh hides what is written into it.
        side: `listen` or `connect`.
    """
    name = setting(config, f"{_TLS}/{side}_certificate")
    if isinstance(name, str):
        try:
            return Path(name).read_text(encoding="utf-8")
        except (OSError, ValueError):
            return None
    return embedded(path, f"{side}_certificate_base64")


def embedded(path: Path, name: str) -> str | None:
    """Returns the text that a file of `mjplug keys` has under a setting of TLS; None without, or for another file."""
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
        told = json.loads("\n".join(line for line in lines if not line.startswith("//")))
        return b64decode(told["transport"]["link"]["tls"][name]).decode()
    except (OSError, ValueError, KeyError, TypeError):
        return None
