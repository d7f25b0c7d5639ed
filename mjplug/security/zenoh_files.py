"""The Zenoh configuration files for the owners of certificates."""

import json
from base64 import b64encode
from typing import Any

from mjplug.security.certificates import Pair


def server(name: str, listen: str) -> str:
    """Returns the file of a server, whose certificates and roles are in other files of the same folder.

    Args:
        name: The server's name, which is also the name of its certificate's files.
        listen: The endpoint that it listens on.
    """
    pair = {"certificate": f"{name}.pem", "private_key": f"{name}.key"}
    tls = {
        "root_ca_certificate": "trust.pem",
        "enable_mtls": True,
        "verify_name_on_connect": True,
        "close_link_on_expiration": True,
        **{f"{way}_{part}": file for way in ("listen", "connect") for part, file in pair.items()},
    }
    return _text(
        [
            f"For `mjplug serve CONFIG --zenoh-config {name}.json5`.",
            "File names are relative to the folder of this file; for other Zenoh programs, to the current folder.",
        ],
        {
            "listen": {"endpoints": [listen]},
            "scouting": {"multicast": {"enabled": False}},
            "transport": {"link": {"tls": tls}},
            "metadata": {"mjplug": {"roles": "roles.json", "worker": "worker.json5"}},
        },
    )


def client(name: str, role: str, authority: str, pair: Pair, endpoint: str) -> str:
    """Returns the file of a client. It includes certificate and key, so any Zenoh program can use it in any folder.

    Args:
        name: The client's name.
        role: Its role, as information for readers and for `mjplug doctor --security`.
        authority: Certificate of the authority that signs server certificates.
        pair: The client's certificate and key.
        endpoint: The endpoint to connect to; empty for none.
    """
    tls = {
        "root_ca_certificate_base64": _base64(authority),
        "enable_mtls": True,
        "verify_name_on_connect": True,
        "close_link_on_expiration": True,
        "connect_certificate_base64": _base64(pair.certificate),
        "connect_private_key_base64": _base64(pair.key),
    }
    return _text(
        [f"Contains the private key of {name}: anybody with this file can connect as {name}. Keep it secret."],
        {
            "mode": "client",
            **({"connect": {"endpoints": [endpoint]}} if endpoint else {}),
            "scouting": {"multicast": {"enabled": False}},
            "timestamping": {"enabled": True},
            "transport": {"link": {"tls": tls}},
            "metadata": {"mjplug": {"role": role}},
        },
    )


def _base64(text: str) -> str:
    return b64encode(text.encode()).decode()


def _text(comments: list[str], value: dict[str, Any]) -> str:
    return "".join(f"// {line}\n" for line in comments) + json.dumps(value, indent=2)
