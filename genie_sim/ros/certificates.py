"""Who a Genie is: a key, a certificate that names it, and the authority whose certificates it trusts. Making them
(``genie-sim keys``) needs OpenSSL 3.

A certificate says ``genie:car/car1`` or ``genie:edge/edge1`` as its only URI (subject alternative name).
"""

import contextlib
import os
import re
import ssl
import subprocess
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from genie_sim.errors import UserError, unknown
from genie_sim.ros.gateway import Peer
from genie_sim.ros.plan import ROLES

NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]{0,63}")
_URI = re.compile(rf"genie:(car|edge)/({NAME.pattern})")
_CERTIFICATE = re.compile("-----BEGIN CERTIFICATE-----.*?-----END CERTIFICATE-----\n", re.DOTALL)
AUTHORITY = "authority.pem"
AUTHORITY_DAYS, PEER_DAYS, MOST_DAYS = 3650, 365, 36500
_AUTHORITY_IS = (
    "basicConstraints = critical, CA:TRUE, pathlen:0\nkeyUsage = critical, keyCertSign, cRLSign"
)
_PEER_IS = """basicConstraints = critical, CA:FALSE
keyUsage = critical, digitalSignature
extendedKeyUsage = serverAuth, clientAuth
authorityKeyIdentifier = keyid
subjectAltName = URI:genie:{role}/{name}"""
_CONFIGURATION = """[req]
prompt = no
distinguished_name = names
x509_extensions = what
[names]
CN = {name}
[what]
subjectKeyIdentifier = hash
{what}
"""


class Refused(Exception):
    """The other side is not who it should be. The connection ends."""


class Credentials:
    """What ``genie-sim keys peer`` writes: key, certificate and authority in one PEM file. Raises UserError."""

    def __init__(self, path: str) -> None:
        try:
            mode, text = Path(path).stat().st_mode, Path(path).read_text(encoding="ascii")
        except (OSError, UnicodeError) as error:
            raise UserError(
                f"{path}: key: {getattr(error, 'strerror', None) or 'no PEM file'}"
            ) from error
        if mode & 0o077:
            raise UserError(f"{path}: key: others may read it; chmod 600 {path}")
        certificates = _CERTIFICATE.findall(text)
        if len(certificates) != 2:
            raise UserError(
                f"{path}: key: {len(certificates)} certificates, not 2; make one: genie-sim keys peer"
            )
        try:
            self.dialling = _context(ssl.PROTOCOL_TLS_CLIENT, path, certificates[1])
            self.listening = _context(ssl.PROTOCOL_TLS_SERVER, path, certificates[1])
            self.owner = self._meets_itself()
        except (ssl.SSLError, Refused) as error:
            raise UserError(f"{path}: key: {reason(error)}") from error

    def _meets_itself(self) -> Peer:
        """Whom another Genie would see: a handshake in memory, with which a key fails that nobody would accept."""
        there, back = ssl.MemoryBIO(), ssl.MemoryBIO()
        dialler, listener = (
            self.dialling.wrap_bio(back, there),
            self.listening.wrap_bio(there, back, server_side=True),
        )
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


def make_authority(folder: Path, days: int = AUTHORITY_DAYS) -> Path:
    """Writes the authority's key and certificate into ``folder`` and returns the file. Raises UserError."""
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    path = folder / AUTHORITY
    _write(path, "".join(_issued("genie-sim authority", _AUTHORITY_IS, days)))
    return path


def make_peer(folder: Path, name: str, role: str, days: int = PEER_DAYS) -> Path:
    """Writes ``NAME.pem``, all that this Genie needs and nothing else, and returns the file. Raises UserError."""
    authority = folder / AUTHORITY
    if role not in ROLES:
        raise UserError(unknown("role", role, ROLES))
    if not NAME.fullmatch(name) or f"{name}.pem" == AUTHORITY:
        raise UserError(
            f"keys: {name!r} is no name of a Genie: up to 64 letters, digits, '_', '-' and '.'"
        )
    if not authority.exists():
        raise UserError(f"{authority}: no such file; make it: genie-sim keys ca {folder}")
    text = authority.read_text(encoding="ascii")
    own = _issued(name, _PEER_IS.format(name=name, role=role), days, authority)
    path = folder / f"{name}.pem"
    _write(path, "".join((*own, text[text.index("-----BEGIN CERTIFICATE-----") :])))
    return path


def _issued(name: str, what: str, days: int, authority: Path | None = None) -> tuple[str, str]:
    """A new key and its certificate, signed by the authority or by itself."""
    if not 1 <= days <= MOST_DAYS:
        raise UserError(f"keys: {days} days; from 1 to {MOST_DAYS}")
    with tempfile.TemporaryDirectory() as folder:
        key, certificate = Path(folder, "key"), Path(folder, "certificate")
        command: list[str | Path] = [
            "openssl",
            "req",
            "-x509",
            "-batch",
            "-nodes",
            "-newkey",
            "ec",
            "-pkeyopt",
            "ec_paramgen_curve:P-256",
            "-sha256",
            "-days",
            str(days),
            "-config",
            "/dev/stdin",
            "-keyout",
            key,
            "-out",
            certificate,
        ]
        if authority is not None:
            command += ["-CA", authority, "-CAkey", authority]
        configuration = _CONFIGURATION.format(name=name, what=what)
        try:
            subprocess.run(command, input=configuration, capture_output=True, text=True, check=True)
            return key.read_text(encoding="ascii"), certificate.read_text(encoding="ascii")
        except FileNotFoundError as error:
            raise UserError("keys: no program 'openssl' here; install OpenSSL 3") from error
        except subprocess.CalledProcessError as error:
            lines = error.stderr.strip().splitlines() or ["it said nothing"]
            raise UserError(f"keys: openssl: {lines[-1]}") from error


def _write(path: Path, text: str) -> None:
    """A file that only its owner may read. Never replaces one: it may be the only copy of a key."""
    try:
        with os.fdopen(
            os.open(path, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o600), "w", encoding="ascii"
        ) as file:
            file.write(text)
    except FileExistsError as error:
        raise UserError(f"{path}: is there already; move it away first") from error
