"""The Zenoh session: a client of a server or router, without multicast."""

import json
import re
import threading
from collections.abc import Callable
from typing import Any

import zenoh

from mjplug_bridge_ros2.settings import Settings

_RETRY = {"period_init_ms": 500, "period_max_ms": 2000, "period_increase_factor": 2}
"""Intervals of Zenoh's reconnection attempts; by default they grow to 4 s."""

_CONNECT_TIMEOUT_MS = 1000
"""Timeout of one connection attempt [ms]."""

_SOURCE_LOCATION = re.compile(r" at /\S*?\.rs:\d+\.?")


def configure(settings: Settings) -> zenoh.Config:
    """Returns the configuration of the session.

    Raises:
        zenoh.ZError: The configuration file or an endpoint is invalid.
    """
    config = zenoh.Config.from_file(settings.zenoh_config) if settings.zenoh_config else zenoh.Config()
    _set(config, "mode", "client")
    if settings.connect:
        _set(config, "connect/endpoints", settings.connect)
    _set(config, "connect/timeout_ms", _CONNECT_TIMEOUT_MS)
    _set(config, "connect/retry", _RETRY)
    _set(config, "scouting/multicast/enabled", False)
    return config


class Connector:
    """Tries to connect in a thread until it succeeds; after that, Zenoh reconnects by itself.

    Args:
        config: The configuration.
        opened: Called with the session on that thread.
        failed: Called with the reason of each failed attempt on that thread.
    """

    def __init__(
        self, config: zenoh.Config, opened: Callable[[zenoh.Session], None], failed: Callable[[str], None]
    ) -> None:
        self._config = config
        self._opened = opened
        self._failed = failed
        self._stopping = threading.Event()
        self._session: zenoh.Session | None = None
        self._thread = threading.Thread(target=self._connect)

    def start(self) -> None:
        """Starts the thread."""
        self._thread.start()

    def close(self) -> None:
        """Stops the thread and closes the session."""
        # The process crashes if a thread is inside Zenoh when Python exits.
        self._stopping.set()
        if self._thread.ident is not None:
            self._thread.join()
        if self._session is not None:
            # zenoh's stubs leave the return type open.
            self._session.close()  # type: ignore[no-untyped-call]

    def _connect(self) -> None:
        while not self._stopping.is_set():
            try:
                self._session = zenoh.open(self._config)
            except zenoh.ZError as error:
                self._failed(plain(error))
                self._stopping.wait(_RETRY["period_init_ms"] / 1000)
            else:
                self._opened(self._session)
                return


def plain(error: zenoh.ZError) -> str:
    """Returns the text of a Zenoh error without source code locations."""
    return _SOURCE_LOCATION.sub("", str(error)).strip()


def _set(config: zenoh.Config, key: str, value: Any) -> None:
    config.insert_json5(key, json.dumps(value))
