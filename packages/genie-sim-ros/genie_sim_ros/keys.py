"""Checks the folder of keys with which a Genie shows who it is: ``ca.pem``, ``NAME.pem`` and
``NAME.key``, made as ``docs/keys.md`` tells.
"""

import contextlib
import socket
import ssl
from pathlib import Path
from typing import Any

from genie_sim.base.errors import UserError, as_user_error, short_repr

AUTHORITY = "ca.pem"


def key_files(folder: Path, name: str) -> tuple[Path, Path, Path]:
    """The authority's certificate, and the certificate and the key of Genie ``name``."""
    return folder / AUTHORITY, folder / f"{name}.pem", folder / f"{name}.key"


def check_keys(folder: Path, name: str) -> None:
    """Raises UserError unless the folder holds a key and a certificate that others would accept as
    Genie ``name``'s.
    """
    authority, certificate, key = key_files(folder, name)
    for path in (authority, certificate, key):
        with as_user_error(str(path), OSError):
            path.open("rb").close()
    if key.stat().st_mode & 0o077:
        raise UserError(f"{key}: others may read it; chmod 600 {key}")
    dials = _context(ssl.PROTOCOL_TLS_CLIENT, authority, certificate, key)
    listens = _context(ssl.PROTOCOL_TLS_SERVER, authority, certificate, key)
    try:
        owner = _name_in_a_handshake(dials, listens)
    except ssl.SSLError as error:
        raise UserError(f"{certificate}: {_reason(error)} (authority: {authority})") from error
    if owner != name:
        raise UserError(
            f"{certificate}: its common name is {short_repr(owner)}; this Genie is {name}"
        )


def why_unreachable(address: str, folder: Path, name: str, patience_s: float) -> str | None:
    """Why Genie ``name`` does not get into TLS at ``host:port``; ``None`` if it does.

    Zenoh does not tell, so this tries it with Python's ``ssl``.
    """
    host, _, port = address.rpartition(":")
    try:
        dials = _context(ssl.PROTOCOL_TLS_CLIENT, *key_files(folder, name))
        with (
            socket.create_connection((host.strip("[]"), int(port)), timeout=patience_s) as plain,
            dials.wrap_socket(plain) as secure,
            contextlib.suppress(TimeoutError),
        ):
            secure.recv(1)  # the listener's refusal comes after the dialler's handshake
    except ssl.SSLError as error:
        return _reason(error)
    except OSError as error:
        return error.strerror or str(error)
    except UserError as error:
        return str(error)
    return None


def _context(
    protocol: ssl._SSLMethod, authority: Path, certificate: Path, key: Path
) -> ssl.SSLContext:
    context = ssl.SSLContext(protocol)
    context.check_hostname = False  # names are Genies', not hosts'
    context.verify_mode = ssl.CERT_REQUIRED
    try:
        context.load_verify_locations(authority)
    except ssl.SSLError as error:
        raise UserError(f"{authority}: no PEM certificate: {_reason(error)}") from error
    try:
        context.load_cert_chain(certificate, key, password="")  # else OpenSSL would ask for one
    except ssl.SSLError as error:
        raise UserError(
            f"{certificate}: no PEM certificate of the key {key}: {_reason(error)}"
        ) from error
    return context


def _name_in_a_handshake(dials: ssl.SSLContext, listens: ssl.SSLContext) -> str | None:
    """The common name that another Genie would see: a handshake in memory. Raises SSLError for a
    certificate that nobody would accept.
    """
    to_listener, to_dialler = ssl.MemoryBIO(), ssl.MemoryBIO()
    dialler = dials.wrap_bio(to_dialler, to_listener)
    listener = listens.wrap_bio(to_listener, to_dialler, server_side=True)
    for side in (dialler, listener, dialler, listener):
        with contextlib.suppress(ssl.SSLWantReadError):
            side.do_handshake()
    certificate: dict[str, Any] = dialler.getpeercert() or {}
    subject = certificate.get("subject", ())
    names = [value for part in subject for kind, value in part if kind == "commonName"]
    return names[0] if names else None


def _reason(error: ssl.SSLError) -> str:
    if isinstance(error, ssl.SSLCertVerificationError):
        return str(error.verify_message)
    return (error.reason or str(error)).lower().replace("_", " ")
