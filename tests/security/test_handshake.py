"""Why a TLS connection was refused, for configurations that Zenoh itself does not take."""

import json
import os
import subprocess
import sys

from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.serialization import BestAvailableEncryption, Encoding, PrivateFormat

ASK = """
import sys
from mjplug.wire.handshake import why_refused
from mjplug.wire.zenoh_file import read_zenoh_file
print(why_refused(read_zenoh_file(sys.argv[1]), None, "tls/127.0.0.1:1"))
"""


def test_nobody_is_asked_for_the_password_of_an_encrypted_key(keys, tmp_path):
    key = ec.generate_private_key(ec.SECP256R1())
    locked = BestAvailableEncryption(b"secret")
    (tmp_path / "key.pem").write_bytes(key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, locked))
    (tmp_path / "certificate.pem").write_bytes((keys.path / "ca.pem").read_bytes())
    tls = {
        "enable_mtls": True,
        "root_ca_certificate": "certificate.pem",
        "connect_certificate": "certificate.pem",
        "connect_private_key": "key.pem",
    }
    file = tmp_path / "zenoh.json5"
    file.write_text(json.dumps({"transport": {"link": {"tls": tls}}}))
    # A terminal without input.
    master, terminal = os.openpty()
    try:
        ran = subprocess.run(
            [sys.executable, "-c", ASK, file], stdin=terminal, capture_output=True, text=True, timeout=30,
            start_new_session=True, check=True,
        )  # fmt: skip
    finally:
        os.close(terminal)
        os.close(master)
    assert ran.stdout == "None\n"
    assert "pass phrase" not in ran.stderr
