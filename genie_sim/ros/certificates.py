"""Who a Genie is: a key, a certificate that names it, and the authority whose certificates it trusts.

A certificate says ``genie:car/car1`` or ``genie:edge/edge1`` as its only URI (subject alternative name).
"""

from __future__ import annotations

import contextlib
import re
import ssl
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from genie_sim.errors import UserError
from genie_sim.ros.gateway import Peer

NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]{0,63}")
_URI = re.compile(rf"genie:(car|edge)/({NAME.pattern})")
_CERTIFICATE = re.compile("-----BEGIN CERTIFICATE-----.*?-----END CERTIFICATE-----\n", re.DOTALL)


class Refused(Exception):
    """The other side is not who it should be. The connection ends."""


class Credentials:
    """What ``genie-sim keys peer`` writes: key, certificate and authority in one PEM file. Raises UserError."""

    def __init__(self, path: str) -> None:
        try:
            mode, text = Path(path).stat().st_mode, Path(path).read_text(encoding="ascii")
        except (OSError, UnicodeError) as error:
            raise UserError(f"{path}: key: {getattr(error, 'strerror', None) or 'no PEM file'}") from error
        if mode & 0o077:
            raise UserError(f"{path}: key: others may read it; chmod 600 {path}")
        certificates = _CERTIFICATE.findall(text)
        if len(certificates) != 2:
            raise UserError(f"{path}: key: {len(certificates)} certificates, not 2; make one: genie-sim keys peer")
        try:
            self.dialling = _context(ssl.PROTOCOL_TLS_CLIENT, path, certificates[1])
            self.listening = _context(ssl.PROTOCOL_TLS_SERVER, path, certificates[1])
            self.owner = self._meets_itself()
        except (ssl.SSLError, Refused) as error:
            raise UserError(f"{path}: key: {reason(error)}") from error

    def _meets_itself(self) -> Peer:
        """Whom another Genie would see: a handshake in memory, with which a key fails that nobody would accept."""
        there, back = ssl.MemoryBIO(), ssl.MemoryBIO()
        dialler, listener = self.dialling.wrap_bio(back, there), self.listening.wrap_bio(there, back, server_side=True)
        for side in (dialler, listener, dialler, listener):
            with contextlib.suppress(ssl.SSLWantReadError):
                side.do_handshake()
        return identity(dialler.getpeercert() or {})


def identity(certificate: Mapping[str, Any]) -> Peer:
    """Name and role that a checked certificate gives. Raises Refused for one that is no Genie's."""
    uris = [value for kind, value in certificate.get("subjectAltName", ()) if kind == "URI"]
    found = _URI.fullmatch(uris[0]) if len(uris) == 1 else None
    if found is None:
        raise Refused("a certificate that names no Genie")
    return Peer(found[2], found[1])


def check(peer: Peer, me: Peer, expected: str | None) -> None:
    """Raises Refused unless ``me`` may talk to ``peer``; a dialler says whom it has ``expected``."""
    if expected not in (None, peer.name):
        raise Refused(f"it is {peer.role} {peer.name}, not {expected}")
    if peer.role == me.role == "car":
        raise Refused(f"it is car {peer.name}; a car has nothing to say to a car")
    if peer.name == me.name:
        raise Refused(f"it is called {peer.name}, too")


def reason(error: Exception) -> str:
    """Why a connection failed, in a few words."""
    if isinstance(error, ssl.SSLCertVerificationError):
        return str(error.verify_message)
    if isinstance(error, ssl.SSLError):
        return (error.reason or str(error)).lower().replace("_", " ")
    return str(getattr(error, "strerror", None) or error or type(error).__name__)


def _context(protocol: ssl._SSLMethod, path: str, authority: str) -> ssl.SSLContext:
    context = ssl.SSLContext(protocol)
    context.check_hostname = False  # names are Genies', not hosts': see ``check``
    context.verify_mode = ssl.CERT_REQUIRED
    context.minimum_version = ssl.TLSVersion.TLSv1_3
    if protocol == ssl.PROTOCOL_TLS_SERVER:
        context.num_tickets = 0  # every connection shows its certificate
    context.load_cert_chain(path, password="")  # nobody is there to be asked for one
    context.load_verify_locations(cadata=authority)
    return context
