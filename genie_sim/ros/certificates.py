"""Who a Genie is: a key, a certificate that names it, the authority whose certificates it trusts,
and the list of those that count no longer. Making them (``genie-sim keys``) needs OpenSSL 3.

A certificate says ``genie:car/car1`` or ``genie:edge/edge1`` as its only URI (subject alternative
name).
"""

import contextlib
import os
import re
import ssl
import subprocess
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from genie_sim.errors import UserError, as_user_error, short_repr, unknown
from genie_sim.paths import atomic_write
from genie_sim.ros.gateway import Peer
from genie_sim.ros.plan import ROLES
from genie_sim.text import one_line

NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]{0,63}")
_URI = re.compile(rf"genie:(car|edge)/({NAME.pattern})")
_SERIAL = re.compile("[0-9A-Fa-f]{1,40}")
_CERTIFICATE = re.compile("-----BEGIN CERTIFICATE-----.*?-----END CERTIFICATE-----\n", re.DOTALL)
AUTHORITY, REVOKED = "authority.pem", "revoked.txt"
AUTHORITY_DAYS, PEER_DAYS, MAX_DAYS = 3650, 365, 36500
_AUTHORITY_EXTENSIONS = (
    "basicConstraints = critical, CA:TRUE, pathlen:0\nkeyUsage = critical, keyCertSign, cRLSign"
)
_PEER_EXTENSIONS = """basicConstraints = critical, CA:FALSE
keyUsage = critical, digitalSignature
extendedKeyUsage = serverAuth, clientAuth
authorityKeyIdentifier = keyid
subjectAltName = URI:genie:{role}/{name}"""
_NEW_CERTIFICATE = ("req", "-x509", "-batch", "-nodes", "-sha256")
_NEW_KEY = ("-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256")
_CONFIGURATION = """[req]
prompt = no
distinguished_name = names
x509_extensions = extensions
[names]
CN = {name}
[extensions]
subjectKeyIdentifier = hash
{extensions}
"""


class Refused(Exception):
    """The other side is not who it should be. The connection ends."""


class Credentials:
    """What ``genie-sim keys peer`` writes: key, certificate and authority in one PEM file. Raises
    UserError.
    """

    def __init__(self, path: str) -> None:
        self.path = path
        self._state = file_state(path)
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
                f"{path}: key: {len(certificates)} certificates, not 2; "
                "make one: genie-sim keys peer"
            )
        try:
            self.dialling = _context(ssl.PROTOCOL_TLS_CLIENT, path, certificates[1])
            self.listening = _context(ssl.PROTOCOL_TLS_SERVER, path, certificates[1])
            self.owner = self._name_in_a_handshake()
        except (ssl.SSLError, Refused) as error:
            raise UserError(f"{path}: key: {reason(error)}") from error

    def renewed(self) -> "Credentials | None":
        """What the file holds now, ``None`` if it is as it was. Raises UserError, once, for a file
        that cannot be used.
        """
        state = file_state(self.path)
        if state == self._state:
            return None
        self._state = state
        return Credentials(self.path)

    def _name_in_a_handshake(self) -> Peer:
        """The name that another Genie would see: a handshake in memory, which fails for a key that
        nobody would accept.
        """
        to_listener, to_dialler = ssl.MemoryBIO(), ssl.MemoryBIO()
        dialler = self.dialling.wrap_bio(to_dialler, to_listener)
        listener = self.listening.wrap_bio(to_listener, to_dialler, server_side=True)
        for side in (dialler, listener, dialler, listener):
            with contextlib.suppress(ssl.SSLWantReadError):
                side.do_handshake()
        return identity(dialler.getpeercert() or {})


class Certificate(NamedTuple):
    """What a checked certificate says. ``issued_s`` and ``ends_s`` bound its validity [s since
    1970].
    """

    owner: Peer
    serial: int
    issued_s: float
    ends_s: float

    @classmethod
    def of(cls, fields: Mapping[str, Any]) -> "Certificate":
        """From what ``ssl`` tells of a certificate. Raises Refused for one that is no Genie's."""
        return cls(
            owner=identity(fields),
            serial=int(str(fields["serialNumber"]), 16),
            issued_s=ssl.cert_time_to_seconds(str(fields["notBefore"])),
            ends_s=ssl.cert_time_to_seconds(str(fields["notAfter"])),
        )


class RevocationList:
    """Certificates that count no longer: a file with one serial number a line, in hexadecimal;
    what follows ``#`` is a comment. Raises UserError for a file that cannot be used.
    """

    def __init__(self, path: str | None) -> None:
        self._path = path
        self._state: tuple[int, ...] | None = None
        self._serials: frozenset[int] = frozenset()
        if path is not None:
            self._state = file_state(path)
            self._serials = read_serials(path)

    def __contains__(self, certificate: Certificate) -> bool:
        return certificate.serial in self._serials

    def reload(self) -> None:
        """Reads the file again if it has changed. Raises UserError, once, for one that cannot be
        used; the serial numbers that were read before stay.
        """
        if self._path is None or (state := file_state(self._path)) == self._state:
            return
        self._state = state
        self._serials = read_serials(self._path)


def read_serials(path: str) -> frozenset[int]:
    """The serial numbers of a list of revoked certificates. Raises UserError."""
    with as_user_error(f"{path}: revoked", OSError, UnicodeError):
        lines = Path(path).read_text(encoding="utf-8").splitlines()
    serials = set()
    for number, line in enumerate(lines, start=1):
        text = line.partition("#")[0].strip()
        if text:
            if _SERIAL.fullmatch(text) is None:
                raise UserError(f"{path}: line {number}: {short_repr(text)} is no serial number")
            serials.add(int(text, 16))
    return frozenset(serials)


def file_state(path: str) -> tuple[int, ...] | None:
    """Tells a file from what it was before; ``None`` if there is none."""
    try:
        status = Path(path).stat()
    except OSError:
        return None
    return status.st_ino, status.st_size, status.st_mtime_ns, status.st_mode


def identity(certificate: Mapping[str, Any]) -> Peer:
    """Name and role that a checked certificate gives. Raises Refused for one that is no Genie's."""
    uris = [value for kind, value in certificate.get("subjectAltName", ()) if kind == "URI"]
    match = _URI.fullmatch(uris[0]) if len(uris) == 1 else None
    if match is None:
        raise Refused("a certificate that names no Genie")
    return Peer(name=match[2], role=match[1])


def check(peer: Peer, own: Peer, expected: str | None) -> None:
    """Raises Refused unless the Genie ``own`` may talk to ``peer``; a dialler names the one that it
    has ``expected``.
    """
    if expected not in (None, peer.name):
        raise Refused(f"it is {peer.role} {peer.name}, not {expected}")
    if peer.role == own.role == "car":
        raise Refused(f"{peer.name} is a car; cars do not connect to cars")
    if peer.name == own.name:
        raise Refused(f"both sides are called {peer.name}")


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
    context.load_cert_chain(path, password="")  # else OpenSSL would ask for one on the terminal
    context.load_verify_locations(cadata=authority)
    return context


def make_authority(folder: Path, days: int = AUTHORITY_DAYS) -> Path:
    """Writes the authority's key and certificate into ``folder`` and returns the file. Raises
    UserError.
    """
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    path = folder / AUTHORITY
    _write(path, "".join(_issued("genie-sim authority", _AUTHORITY_EXTENSIONS, days)))
    return path


def make_peer(folder: Path, name: str, role: str, days: int = PEER_DAYS) -> Path:
    """Writes ``NAME.pem``, all that this Genie needs and nothing else, and returns the file. Raises
    UserError.
    """
    if role not in ROLES:
        raise UserError(unknown("role", role, ROLES))
    if not NAME.fullmatch(name) or f"{name}.pem" == AUTHORITY:
        raise UserError(
            f"keys: {name!r} is no name of a Genie: up to 64 letters, digits, '_', '-' and '.'"
        )
    authority = _authority(folder)
    text = authority.read_text(encoding="ascii")
    extensions = _PEER_EXTENSIONS.format(name=name, role=role)
    path = folder / f"{name}.pem"
    key, certificate = _issued(name, extensions, days, authority)
    _write(path, key + certificate + text[text.index("-----BEGIN CERTIFICATE-----") :])
    return path


def revoke(folder: Path, key_file: Path) -> Path:
    """Adds the certificate in ``key_file`` to the folder's list of those that count no longer, and
    returns the list's file. Raises UserError.
    """
    _authority(folder)
    if not key_file.is_file():
        raise UserError(f"{key_file}: no such file")
    shown = _openssl("x509", "-in", key_file, "-noout", "-serial")
    path = folder / REVOKED
    text = path.read_text(encoding="utf-8") if path.exists() else ""
    serial = shown.strip().removeprefix("serial=")
    if path.exists() and int(serial, 16) in read_serials(str(path)):
        raise UserError(f"{path}: the certificate of {key_file} is revoked already")
    with atomic_write(path) as beside:
        beside.write_text(f"{text}{serial}  # {one_line(key_file.name)}\n", encoding="utf-8")
    return path


def _authority(folder: Path) -> Path:
    path = folder / AUTHORITY
    if not path.exists():
        raise UserError(f"{path}: no such file; make it: genie-sim keys ca {folder}")
    return path


def _issued(
    name: str, extensions: str, days: int, authority: Path | None = None
) -> tuple[str, str]:
    """A new key and its certificate, signed by the authority or by itself."""
    if not 1 <= days <= MAX_DAYS:
        raise UserError(f"keys: {days} days; from 1 to {MAX_DAYS}")
    signer: list[str | Path] = [] if authority is None else ["-CA", authority, "-CAkey", authority]
    with tempfile.TemporaryDirectory() as folder:
        key, certificate = Path(folder, "key"), Path(folder, "certificate")
        _openssl(
            *_NEW_CERTIFICATE,
            *_NEW_KEY,
            *("-config", "/dev/stdin", "-keyout", key, "-out", certificate, "-days", str(days)),
            *signer,
            stdin=_CONFIGURATION.format(name=name, extensions=extensions),
        )
        return key.read_text(encoding="ascii"), certificate.read_text(encoding="ascii")


def _openssl(*arguments: str | Path, stdin: str = "") -> str:
    """What the program ``openssl`` prints. Raises UserError with its last line if it fails."""
    try:
        done = subprocess.run(
            ["openssl", *arguments], input=stdin, capture_output=True, text=True, check=True
        )
    except FileNotFoundError as error:
        raise UserError("keys: no program 'openssl' here; install OpenSSL 3") from error
    except subprocess.CalledProcessError as error:
        lines = error.stderr.strip().splitlines() or ["(no output)"]
        raise UserError(f"keys: openssl: {lines[-1]}") from error
    return done.stdout


def _write(path: Path, text: str) -> None:
    """A file that only its owner may read. Never replaces one: it may be the only copy of a key."""
    try:
        descriptor = os.open(path, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o600)
        with os.fdopen(descriptor, "w", encoding="ascii") as file:
            file.write(text)
    except FileExistsError as error:
        raise UserError(f"{path}: is there already; move it away first") from error
