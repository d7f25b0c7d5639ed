"""Reads Zenoh configuration files.

Relative file names in a file are searched in the file's folder first, shared memory is off unless the file sets it, and
`metadata: {mjplug: …}` contains mjplug's own settings.
"""

import json
import os
import re
from base64 import b64decode
from pathlib import Path
from typing import Any

import zenoh

SHARED_MEMORY = "transport/shared_memory/enabled"
"""The setting is off unless the user's file contains the section `shared_memory`.

With shared memory, which is on by default in Zenoh, a process maps 16 MiB for every peer that ever sent it more than
3 kB, and never unmaps them. The /dev/shm of a container, usually 64 MiB, is then full after four clients.
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
    """Returns the configuration of a file (JSON5, JSON or YAML); without a file, Zenoh's defaults.

    Zenoh searches relative file names in the current folder. Here, the folder of the configuration file is searched
    first, so that the program can be started in any folder.

    Raises:
        zenoh.ZError: The file cannot be read, or contains an unknown setting.
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
    # Search the text, because a parsed configuration does not show whether `true` is the file's value or the default.
    text = path.read_text(encoding="utf-8", errors="replace")
    return _SECTION.search(_COMMENTS.sub(lambda match: match[1] or " ", text)) is not None


def setting(config: zenoh.Config, key: str) -> Any:
    """Returns a setting of a configuration; None if it or its section is not set."""
    try:
        return json.loads(config.get_json(key))
    except (zenoh.ZError, KeyError, ValueError):
        return None


def own_settings(config: zenoh.Config) -> dict[str, Any]:
    """Returns mjplug's own settings in a file, `metadata: {mjplug: …}`; empty if there are none."""
    metadata = setting(config, "metadata")
    own = metadata.get("mjplug") if isinstance(metadata, dict) else None
    return own if isinstance(own, dict) else {}


def certificate(config: zenoh.Config, path: Path, side: str) -> str | None:
    """Returns a program's own certificate as PEM text; None if the configuration has no readable certificate.

    Args:
        config: The configuration.
        path: The file of the configuration. It is read again, because Zenoh hides embedded certificates.
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
    """Returns the text of a TLS setting in a file made by `mjplug keys`; None if it is not set or for another file."""
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
        content = json.loads("\n".join(line for line in lines if not line.startswith("//")))
        return b64decode(content["transport"]["link"]["tls"][name]).decode()
    except (OSError, ValueError, KeyError, TypeError):
        return None
