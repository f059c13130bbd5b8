"""``genie-sim keys``: an authority, and key files that say who is who."""

from __future__ import annotations

import contextlib
import ssl
from pathlib import Path
from typing import Any

import pytest

from genie_sim.cli import main
from genie_sim.errors import UserError
from genie_sim.ros.certificates import (
    Certificate,
    Credentials,
    RevocationList,
    identity,
    make_authority,
    make_peer,
    read_serials,
)
from genie_sim.ros.gateway import Peer


@pytest.fixture
def folder(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Path:
    assert main(["keys", "ca", str(tmp_path / "keys")]) == 0
    assert capsys.readouterr().out == f"{tmp_path}/keys/authority.pem\n"
    return tmp_path / "keys"


def refused(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    """The one line with which ``genie-sim keys`` refuses."""
    assert main(["keys", *words]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    return line


@pytest.mark.process
def test_a_peer_s_file_says_who_it_is_and_is_private(
    folder: Path, capsys: pytest.CaptureFixture[str]
):
    for name, role in (("car1", "car"), ("edge-1.b", "edge")):
        assert main(["keys", "peer", name, "--role", role, "--ca", str(folder)]) == 0
        path = Path(capsys.readouterr().out.strip())
        assert path == folder / f"{name}.pem" and Credentials(str(path)).owner == Peer(name, role)
    assert {path.stat().st_mode & 0o777 for path in folder.iterdir()} == {
        0o600
    } and folder.stat().st_mode & 0o077 == 0
    text = (folder / "car1.pem").read_text()
    assert text.count("PRIVATE KEY") == 2, "its own: the authority's stays where it is"
    assert (folder / "authority.pem").read_text().split("-----BEGIN CERT")[0] not in text


def test_what_makes_no_key_is_said_in_a_line(
    folder: Path, capsys: pytest.CaptureFixture[str], tmp_path: Path
):
    ca = ("--ca", str(folder))
    assert "authority.pem: is there already" in refused(capsys, "ca", str(folder))
    assert "unknown role 'bus'" in refused(capsys, "peer", "car1", "--role", "bus", *ca)
    for name in ("../x", "car 1", "", "a" * 65, "authority", "car1\nURI:genie:edge/x", "-x/y"):
        assert "is no name of a Genie" in refused(capsys, "peer", "--role", "car", *ca, "--", name)
    assert "0 days; from 1 to 36500" in refused(
        capsys, "peer", "car1", "--role", "car", "--days", "0", *ca
    )
    assert "no such file; make it: genie-sim keys ca" in refused(
        capsys, "peer", "car1", "--role", "car", "--ca", str(tmp_path / "nowhere")
    )
    assert main(["keys", "peer", "car1", "--role", "car", *ca]) == 0
    assert "car1.pem: is there already" in refused(capsys, "peer", "car1", "--role", "edge", *ca)


@pytest.mark.process
def test_no_openssl(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setenv("PATH", str(tmp_path))
    assert "no program 'openssl' here" in refused(capsys, "ca", str(tmp_path / "keys"))


def test_a_revoked_certificate_stands_in_the_list(
    folder: Path, capsys: pytest.CaptureFixture[str], tmp_path: Path
):
    ca = ("--ca", str(folder))
    files = [make_peer(folder, name, "car") for name in ("car1", "car2")]
    for count, file in enumerate(files, start=1):
        assert main(["keys", "revoke", str(file), *ca]) == 0
        assert capsys.readouterr().out == f"{folder}/revoked.txt\n"
        assert len(read_serials(str(folder / "revoked.txt"))) == count
    revoked = RevocationList(str(folder / "revoked.txt"))
    certificates = [certificate_of(file) for file in files]
    assert all(certificate in revoked for certificate in certificates)
    assert certificate_of(make_peer(folder, "car3", "car")) not in revoked
    again = refused(capsys, "revoke", str(files[0]), *ca)
    assert again.endswith(f"revoked.txt: the certificate of {files[0]} is revoked already")
    assert "nowhere.pem: no such file" in refused(
        capsys, "revoke", str(tmp_path / "nowhere.pem"), *ca
    )
    (tmp_path / "text").write_text("no certificate")
    assert "keys: openssl: " in refused(capsys, "revoke", str(tmp_path / "text"), *ca)
    assert "make it: genie-sim keys ca" in refused(
        capsys, "revoke", str(files[0]), "--ca", str(tmp_path / "nowhere")
    )


@pytest.mark.parametrize("line", ["0x12", "-1", "12 34", "serial=12", "1" * 41, "é"])
def test_what_is_no_serial_number_is_named_with_its_line(tmp_path: Path, line: str):
    path = tmp_path / "revoked.txt"
    path.write_text(f"# comment\n\n0Ab1 # car1.pem\n{line}\n")
    with pytest.raises(UserError, match=r"revoked.txt: line 4: '.*' is no serial number"):
        RevocationList(str(path))


@pytest.mark.process
def test_keys_are_revoked_by_a_new_authority(tmp_path: Path):
    """As ``docs/explanation/security.md`` tells: a new authority, new files for all others,
    attached again.
    """
    old, new = tmp_path / "old", tmp_path / "new"
    for folder in (old, new):
        make_authority(folder)
    stolen = {
        name: make_peer(old, name, role) for name, role in (("car1", "car"), ("edge2", "edge"))
    }
    fresh = {
        name: make_peer(new, name, role) for name, role in (("car2", "car"), ("edge1", "edge"))
    }
    assert meet(fresh["car2"], fresh["edge1"]) == (Peer("car2", "car"), Peer("edge1", "edge"))
    for dials, listens in ((stolen["car1"], fresh["edge1"]), (fresh["car2"], stolen["edge2"])):
        with pytest.raises(ssl.SSLError):
            meet(dials, listens)


@pytest.mark.process
def test_an_old_and_a_renewed_certificate_are_both_good(tmp_path: Path):
    """So Genies are renewed one by one."""
    make_authority(tmp_path)
    edge, car = make_peer(tmp_path, "edge1", "edge"), make_peer(tmp_path, "car1", "car")
    older = car.rename(tmp_path / "car1.old")
    renewed = make_peer(tmp_path, "car1", "car")
    assert meet(older, edge) == meet(renewed, edge) == (Peer("car1", "car"), Peer("edge1", "edge"))
    assert older.read_bytes() != renewed.read_bytes()


def certificate_of(file: Path) -> Certificate:
    """What the other side of a connection learns."""
    (certificate, _) = shake_hands(file, file)
    return Certificate.of(certificate)


def meet(dials: Path, listens: Path) -> tuple[Peer, Peer]:
    """Whom listener and dialler have met. Raises ssl.SSLError."""
    to_listener, to_dialler = shake_hands(dials, listens)
    return identity(to_listener), identity(to_dialler)


def shake_hands(dials: Path, listens: Path) -> tuple[dict[str, Any], dict[str, Any]]:
    """The certificates that the listener and the dialler see, after a handshake in memory. Raises
    ssl.SSLError.
    """
    to_listener, to_dialler = ssl.MemoryBIO(), ssl.MemoryBIO()
    dialler = Credentials(str(dials)).dialling.wrap_bio(to_dialler, to_listener)
    listening = Credentials(str(listens)).listening
    listener = listening.wrap_bio(to_listener, to_dialler, server_side=True)
    for side in (dialler, listener, dialler, listener):
        with contextlib.suppress(ssl.SSLWantReadError):
            side.do_handshake()
    return listener.getpeercert() or {}, dialler.getpeercert() or {}
