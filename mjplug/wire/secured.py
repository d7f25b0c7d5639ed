"""Turns what a Zenoh file says about roles and certificates into the settings of a server's session."""

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

_SOON = timedelta(days=30)
"""How long before its certificate expires a server warns."""

_TLS = "transport/link/tls"


def secured(settings: SessionSettings, declare: Callable[[], Interfaces]) -> SessionSettings:
    """Returns the settings with the access rules for the roles in the Zenoh file, if there are any.

    Args:
        settings: The settings.
        declare: Returns what the server will declare; called only if there are roles.

    Raises:
        WireError: The file says something about certificates or roles that cannot work.
    """
    path = settings.config
    if path is None:
        return settings
    try:
        config = read_zenoh_file(path)
    except zenoh.ZError:
        # Opening the session reports it.
        return settings
    _check_certificate(config, path)
    own = own_settings(config)
    _check_workers(config, path, "worker" in own)
    if "worker" in own:
        settings = replace(settings, worker_config=_beside(path, own["worker"]))
    if "roles" not in own:
        return settings
    roles, known_by = _roles(config, path, own["roles"])
    return replace(settings, access_control=access_control(declare(), roles, known_by))


def _check_certificate(config: zenoh.Config, path: Path) -> None:
    pem = certificate(config, path, "listen")
    until = None if pem is None else expiry_of(pem)
    if until is None:
        return
    renew = f"make a new one (mjplug keys renew {path.stem}, if `mjplug keys` made it)"
    now = datetime.now(UTC)
    if until <= now:
        raise WireError(f"the certificate of this server (in {path}) expired on {day(until)}; {renew}")
    if until - now < _SOON:
        _LOG.warning("the certificate of this server (in %s) expires on %s; %s", path, day(until), renew)


def _check_workers(config: zenoh.Config, path: Path, have_own: bool) -> None:
    if have_own or setting(config, f"{_TLS}/listen_certificate") is None:
        return
    if setting(config, f"{_TLS}/root_ca_certificate") is None:
        _LOG.warning(
            "%s has no root_ca_certificate: worker processes of cameras and lidars connect to this server over TLS, "
            "and need the certificate of its authority; add transport.link.tls.root_ca_certificate",
            path,
        )


def _roles(config: zenoh.Config, path: Path, given: Any) -> tuple[Mapping[str, Role], str]:
    """Returns the roles by name, and how Zenoh knows the names."""
    source = path
    if isinstance(given, str):
        source = _beside(path, given)
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
            f"{path} has both access_control and roles (metadata.mjplug.roles), from which mjplug makes the rules of "
            "access_control; take one of them out"
        )
    if setting(config, f"{_TLS}/enable_mtls"):
        return roles, "cert_common_names"
    if setting(config, "transport/auth/usrpwd/dictionary_file") is not None:
        return roles, "usernames"
    raise WireError(
        f"{path} has roles, but no way to know who a client is; add certificates (transport.link.tls.enable_mtls, as "
        "`mjplug keys init` makes them) or passwords (transport.auth.usrpwd.dictionary_file)"
    )


def _beside(path: Path, name: Any) -> Path:
    if not isinstance(name, str):
        raise WireError(f"{path}: metadata.mjplug names files by text, not by {name!r}")
    return path.resolve().parent / name
