"""Applies the roles and certificates of a Zenoh file to the settings of a server's session."""

import json
import logging
from collections.abc import Callable, Mapping
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import zenoh

from mjplug.errors import WireError
from mjplug.security.expiry import day, expiry_of
from mjplug.security.roles import KeysError, Role, read_roles
from mjplug.wire.access import Interfaces, access_control
from mjplug.wire.session import SessionSettings
from mjplug.wire.zenoh_file import certificate, own_settings, read_zenoh_file, setting

_LOG = logging.getLogger(__name__)

_EXPIRY_WARNING = timedelta(days=30)
"""The server logs a warning if its certificate expires within this time."""

_TLS = "transport/link/tls"


def secured(settings: SessionSettings, declare: Callable[[], Interfaces]) -> SessionSettings:
    """Returns the settings with the access rules for the roles in the Zenoh file, if it has roles.

    Args:
        settings: The settings.
        declare: Returns the topics and services of the server; called only if the file has roles.

    Raises:
        WireError: The certificates or roles in the file are invalid.
    """
    path = settings.config
    if path is None:
        return settings
    try:
        config = read_zenoh_file(path)
    except zenoh.ZError:
        # Opening the session reports this error.
        return settings
    _check_certificate(config, path)
    own = own_settings(config)
    _check_workers(config, path, "worker" in own)
    if "worker" in own:
        settings = replace(settings, worker_config=_relative_to(path, own["worker"]))
    if "roles" not in own:
        return settings
    roles, identified_by = _roles(config, path, own["roles"])
    return replace(settings, access_control=access_control(declare(), roles, identified_by))


def _check_certificate(config: zenoh.Config, path: Path) -> None:
    pem = certificate(config, path, "listen")
    until = None if pem is None else expiry_of(pem)
    if until is None:
        return
    renew = f"make a new one (mjplug keys renew {path.stem}, if `mjplug keys` made it)"
    now = datetime.now(UTC)
    if until <= now:
        raise WireError(f"the certificate of this server (in {path}) expired on {day(until)}; {renew}")
    if until - now < _EXPIRY_WARNING:
        _LOG.warning("the certificate of this server (in %s) expires on %s; %s", path, day(until), renew)


def _check_workers(config: zenoh.Config, path: Path, have_own: bool) -> None:
    if have_own or setting(config, f"{_TLS}/listen_certificate") is None:
        return
    if setting(config, f"{_TLS}/root_ca_certificate") is None:
        _LOG.warning(
            "%s has no root_ca_certificate, which the worker processes of cameras and lidars need to connect to this "
            "server over TLS; add transport.link.tls.root_ca_certificate",
            path,
        )


def _roles(config: zenoh.Config, path: Path, given: Any) -> tuple[Mapping[str, Role], str]:
    """Returns the role of each client by its name, and where Zenoh reads the names."""
    source = path
    if isinstance(given, str):
        source = _relative_to(path, given)
        try:
            given = json.loads(source.read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            raise WireError(f"the roles in {source} (named in {path}) cannot be read: {error}") from None
    try:
        roles = read_roles(given, str(source))
    except KeysError as error:
        raise WireError(str(error)) from None
    if setting(config, "access_control/enabled"):
        raise WireError(
            f"{path} has both access_control and roles (metadata.mjplug.roles), from which mjplug generates "
            "access_control; remove one of them"
        )
    if setting(config, f"{_TLS}/enable_mtls"):
        return roles, "cert_common_names"
    if setting(config, "transport/auth/usrpwd/dictionary_file") is not None:
        return roles, "usernames"
    raise WireError(
        f"{path} has roles, but clients are not authenticated; add certificates (transport.link.tls.enable_mtls, see "
        "`mjplug keys init`) or passwords (transport.auth.usrpwd.dictionary_file)"
    )


def _relative_to(path: Path, name: Any) -> Path:
    if not isinstance(name, str):
        raise WireError(f"{path}: a file name in metadata.mjplug is {name!r}; it must be a string")
    return path.resolve().parent / name
