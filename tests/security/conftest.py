"""A folder of keys that the tests share, and clients that know nothing of mjplug."""

import json
import queue
from contextlib import ExitStack

import pytest
import zenoh
from waits import TIMEOUT
from zenoh.handlers import Callback

from mjplug.security.folder import KeyFolder
from mjplug.wire.zenoh_file import read_zenoh_file


@pytest.fixture(scope="session")
def keys(tmp_path_factory):
    """An authority with an identity of each role, bob who was revoked and eve whose certificate has expired."""
    folder = KeyFolder.create(tmp_path_factory.mktemp("lab") / "keys", ["localhost"])
    folder.add("bob", "operator")
    kept = folder.file(folder.identities["bob"]).read_text()
    folder.revoke("bob")
    (folder.path / "bob.json5").write_text(kept)
    (folder.path / "bob.json5").chmod(0o600)
    folder.add("eve", "operator", days=-1.0)
    return folder


class Client:
    """A Zenoh client with the file of somebody."""

    def __init__(self, file, endpoint, patience_ms=5000):
        config = read_zenoh_file(file)
        config.insert_json5("connect/endpoints", json.dumps([endpoint]))
        for key in ("connect/timeout_ms", "transport/unicast/open_timeout"):
            config.insert_json5(key, str(patience_ms))
        self.session = zenoh.open(config)
        self._kept = []

    def listen(self, key):
        samples = queue.SimpleQueue()
        self._kept.append(self.session.declare_subscriber(key, Callback(samples.put, indirect=False)))
        return samples

    def ask(self, selector, **options):
        """All replies to a query: their payloads."""
        replies = self.session.get(selector, timeout=options.pop("timeout", TIMEOUT), **options)
        return [bytes((reply.ok or reply.err).payload) for reply in replies]

    def settle(self):
        """Returns when the server has handled what was sent before: an answer comes after it on the same link."""
        assert self.ask("mjplug/interfaces")

    def tokens(self, key):
        return [str(reply.ok.key_expr) for reply in self.session.liveliness().get(key, timeout=TIMEOUT)]

    def keep(self, declared):
        self._kept.append(declared)
        return declared

    def close(self):
        self.session.close()


@pytest.fixture
def opened():
    with ExitStack() as stack:

        def keep(closeable):
            stack.callback(closeable.close)
            return closeable

        yield keep
