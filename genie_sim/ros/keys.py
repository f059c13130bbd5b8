"""The keys of linked Genies: a small certificate authority, and certificates that say who is who. Needs OpenSSL 3."""

from __future__ import annotations

import os
import subprocess
import tempfile
from pathlib import Path

from genie_sim.errors import UserError, unknown
from genie_sim.ros.certificates import NAME
from genie_sim.ros.plan import ROLES

AUTHORITY = "authority.pem"
AUTHORITY_DAYS, PEER_DAYS, MOST_DAYS = 3650, 365, 36500
_AUTHORITY_IS = "basicConstraints = critical, CA:TRUE, pathlen:0\nkeyUsage = critical, keyCertSign, cRLSign"
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
        raise UserError(f"keys: {name!r} is no name of a Genie: up to 64 letters, digits, '_', '-' and '.'")
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
            "openssl", "req", "-x509", "-batch", "-nodes", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256",
            "-sha256", "-days", str(days), "-config", "/dev/stdin", "-keyout", key, "-out", certificate,
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
        with os.fdopen(os.open(path, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o600), "w", encoding="ascii") as file:
            file.write(text)
    except FileExistsError as error:
        raise UserError(f"{path}: is there already; move it away first") from error
