"""What `mjplug keys` writes. Certificates are verified by OpenSSL, through Python's `ssl`."""

import json
import socket
import ssl
import stat
import threading
from datetime import UTC, datetime, timedelta

import pytest

from mjplug.security.expiry import expiry_of, with_expiry
from mjplug.security.folder import KeyFolder
from mjplug.security.roles import KeysError
from mjplug.wire.zenoh_file import embedded


def parts(file, folder):
    """Writes what a client's file has in it where OpenSSL finds it; returns the paths."""
    names = ("root_ca_certificate", "connect_certificate", "connect_private_key")
    for name in names:
        (folder / name).write_text(embedded(file, f"{name}_base64"))
    return [folder / name for name in names]


def handshake(keys, file, tmp_path, host="localhost"):
    """Returns OpenSSL's result on the server's and on the client's side: None, or the error."""
    here = keys.path / "server"
    server = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    server.load_cert_chain(here / "server.pem", here / "server.key")
    server.load_verify_locations(here / "trust.pem")
    server.verify_mode = ssl.CERT_REQUIRED
    ca, certificate, key = parts(file, tmp_path)
    client = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    client.load_verify_locations(ca)
    client.load_cert_chain(certificate, key)
    ends = socket.socketpair()
    result = {}

    def serve():
        try:
            with server.wrap_socket(ends[0], server_side=True) as secure:
                secure.sendall(b".")
                result["subject"] = dict(part for (part,) in secure.getpeercert()["subject"])
        except ssl.SSLError as error:
            result["server"] = error

    thread = threading.Thread(target=serve)
    thread.start()
    try:
        with client.wrap_socket(ends[1], server_hostname=host) as secure:
            secure.recv(1)
    except (ssl.SSLError, OSError) as error:
        result["client"] = error
    thread.join(20.0)
    return result


@pytest.mark.parametrize("host", ["localhost", "127.0.0.1"])
def test_a_valid_client_and_the_server_accept_each_other(keys, tmp_path, host):
    assert handshake(keys, keys.path / "viewer.json5", tmp_path, host) == {"subject": {"commonName": "viewer"}}


def test_a_client_does_not_accept_the_server_under_a_name_that_it_does_not_have(keys, tmp_path):
    result = handshake(keys, keys.path / "viewer.json5", tmp_path, "sim.example")
    assert isinstance(result["client"], ssl.SSLCertVerificationError)


@pytest.mark.parametrize(("name", "reason"), [("bob", "verify failed: .*issuer"), ("eve", "certificate has expired")])
def test_a_server_accepts_neither_a_revoked_nor_an_expired_client(keys, tmp_path, name, reason):
    result = handshake(keys, keys.path / f"{name}.json5", tmp_path)
    with pytest.raises(ssl.SSLCertVerificationError, match=reason):
        raise result["server"]


def test_a_name_that_was_revoked_gets_a_new_certificate_and_the_old_one_stays_worthless(tmp_path):
    keys = KeyFolder.create(tmp_path / "keys", ["localhost"])
    old = tmp_path / "old.json5"
    keys.add("alice", "viewer").rename(old)
    keys.revoke("alice")
    new = keys.add("alice", "operator")
    assert "server" in handshake(keys, old, tmp_path)
    assert handshake(keys, new, tmp_path)["subject"] == {"commonName": "alice"}


def test_a_renewed_client_gets_in_and_its_old_certificate_does_not(tmp_path):
    keys = KeyFolder.create(tmp_path / "keys", ["localhost"])
    old = tmp_path / "old.json5"
    (keys.path / "viewer.json5").rename(old)
    new = keys.renew("viewer")
    assert "server" in handshake(keys, old, tmp_path)
    assert handshake(keys, new, tmp_path)["subject"] == {"commonName": "viewer"}


def test_a_client_cannot_sign_certificates_that_the_server_accepts(keys, tmp_path):
    from cryptography import x509

    _, certificate, _ = parts(keys.path / "viewer.json5", tmp_path)
    read = x509.load_pem_x509_certificate(certificate.read_bytes())
    assert read.extensions.get_extension_for_class(x509.BasicConstraints).value.ca is False
    assert read.extensions.get_extension_for_class(x509.KeyUsage).value.key_cert_sign is False


def test_only_the_owner_can_read_the_folder(keys):
    for path in [keys.path, *keys.path.rglob("*")]:
        assert stat.S_IMODE(path.stat().st_mode) == (0o700 if path.is_dir() else 0o600), path


def test_an_authority_is_never_overwritten(tmp_path):
    keys = KeyFolder.create(tmp_path, ["localhost"])
    before = {path: path.read_bytes() for path in keys.path.rglob("*") if path.is_file()}
    with pytest.raises(KeysError, match="already contains an authority"):
        KeyFolder.create(tmp_path, ["localhost"])
    assert {path: path.read_bytes() for path in keys.path.rglob("*") if path.is_file()} == before


@pytest.mark.parametrize("host", ["", "a b", "host:7447", "*.lab", "-x", "tls/x", "x" * 254, "münchen", "::", "x..y"])
def test_a_wrong_host_leaves_nothing_so_that_a_second_attempt_works(tmp_path, host):
    with pytest.raises(KeysError, match=r"is neither a host name nor an IP address|means all addresses"):
        KeyFolder.create(tmp_path / "keys", [host])
    assert list(tmp_path.iterdir()) == []
    assert KeyFolder.create(tmp_path / "keys", ["sim_1.lab.example", "192.168.1.5", "fd00::5"]).identities


def test_what_cannot_be_written_is_reported_and_a_second_attempt_works(tmp_path):
    (tmp_path / "operator.json5").mkdir()
    with pytest.raises(KeysError, match=r"cannot write .*operator\.json5: "):
        KeyFolder.create(tmp_path, ["localhost"])
    (tmp_path / "operator.json5").rmdir()
    assert KeyFolder.create(tmp_path, ["localhost"]).identities


def test_a_folder_that_was_there_keeps_its_mode(tmp_path):
    tmp_path.chmod(0o755)
    KeyFolder.create(tmp_path, ["localhost"])
    assert stat.S_IMODE(tmp_path.stat().st_mode) == 0o755
    assert {stat.S_IMODE(path.stat().st_mode) for path in tmp_path.rglob("*") if path.is_file()} == {0o600}


@pytest.mark.parametrize("text", ["[]", "{}", '{"format": 1}', '{"format": 1, "port": 1, "identities": [{}]}', "{"])
def test_a_damaged_list_is_reported_as_damaged(tmp_path, text):
    path = KeyFolder.create(tmp_path, ["localhost"]).path
    (path / "keys.json").write_text(text)
    with pytest.raises(KeysError, match=r"keys\.json (is damaged|cannot be read)"):
        KeyFolder(path)


def test_each_server_gets_the_roles_and_issuers_of_all_who_are_valid(tmp_path):
    keys = KeyFolder.create(tmp_path, ["localhost"])
    keys.add("sim2", "server", ["sim2.example"])
    keys.add("alice", "viewer")
    keys.revoke("operator")
    for server in ("server", "sim2"):
        roles = json.loads((tmp_path / server / "roles.json").read_text())
        assert roles == {
            "worker": "worker", "server": "server", "viewer": "viewer", "sim2": "server", "alice": "viewer"
        }  # fmt: skip
        # The authority, and an issuer each of the worker, the viewer and alice.
        assert (tmp_path / server / "trust.pem").read_text().count("BEGIN CERTIFICATE") == 4
        assert (tmp_path / server / "worker.json5").read_text() == (tmp_path / "worker.json5").read_text()
    assert not (tmp_path / "operator.json5").exists()


def test_what_was_written_is_read_again(keys):
    assert KeyFolder(keys.path).identities == keys.identities


@pytest.mark.parametrize(
    ("act", "sentence"),
    [
        (lambda keys: keys.add("viewer", "operator"), "already has a certificate .viewer, valid.*keys renew viewer"),
        (lambda keys: keys.add("../x", "viewer"), "name '../x' is not allowed"),
        (lambda keys: keys.add("", "viewer"), "name '' is not allowed"),
        (lambda keys: keys.add("x" * 32, "viewer"), "1 to 31 letters"),
        (lambda keys: keys.add("sim2", "server"), "--host NAME"),
        (lambda keys: keys.add("sim2", "server", ["höst"]), "'höst' is neither a host name nor an IP address"),
        (lambda keys: keys.add("sim2", "server", ["0.0.0.0"]), "0.0.0.0 means all addresses"),
        (lambda keys: keys.add("trust", "server", ["x"]), "trust is the name of another file"),
        (lambda keys: keys.add("ca.key", "server", ["x"]), "ca.key is the name of another file"),
        (lambda keys: keys.add("Viewer", "viewer"), "Viewer differs from viewer only in upper and lower case"),
        (lambda keys: keys.add("alice", "viewer", ["x"]), "--host is for servers only"),
        (lambda keys: keys.add("bob", "server", ["x"]), "bob had the role operator"),
        (lambda keys: keys.renew("bob"), "bob was revoked"),
        (lambda keys: keys.renew("nobody"), "unknown name 'nobody'.*known: worker, server"),
        (lambda keys: keys.revoke("bob"), "bob was already revoked on 20"),
        (lambda keys: keys.revoke("server"), "make a new authority in another folder"),
    ],
)  # fmt: skip
def test_an_invalid_request_is_refused_with_a_message_and_changes_nothing(keys, act, sentence):
    before = dict(keys.identities)
    with pytest.raises(KeysError, match=sentence):
        act(keys)
    assert keys.identities == before == KeyFolder(keys.path).identities


def test_a_folder_without_an_authority_says_how_to_make_one(tmp_path):
    with pytest.raises(KeysError, match=r"contains no authority .keys.json is missing.*mjplug keys init --out"):
        KeyFolder(tmp_path)


def test_expiry_is_read_from_the_certificate_and_without_the_library_from_the_line_before_it(keys, monkeypatch):
    import sys

    until = datetime.now(UTC) + timedelta(days=365)
    pem = (keys.path / "server" / "server.pem").read_text()
    assert abs(expiry_of(pem) - until) < timedelta(minutes=10)
    with_library = expiry_of(pem)
    monkeypatch.setitem(sys.modules, "cryptography", None)
    assert expiry_of(pem) == with_library
    assert expiry_of(pem.partition("\n")[2]) is None
    assert expiry_of(with_expiry("x", datetime(2030, 1, 2, tzinfo=UTC))) == datetime(2030, 1, 2, tzinfo=UTC)
