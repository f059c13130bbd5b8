"""``genie-sim keys``: an authority, and key files that say who is who."""

from __future__ import annotations

import contextlib
import ssl
from pathlib import Path

import pytest

from genie_sim.cli import main
from genie_sim.ros.certificates import Credentials, identity, make_authority, make_peer
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


def test_no_openssl(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setenv("PATH", str(tmp_path))
    assert "no program 'openssl' here" in refused(capsys, "ca", str(tmp_path / "keys"))


def test_keys_are_revoked_by_a_new_authority(tmp_path: Path):
    """As ``docs/explanation/security.md`` tells: a new authority, new files for all others, attached again."""
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


def test_an_old_and_a_renewed_certificate_are_both_good(tmp_path: Path):
    """So Genies are renewed one by one."""
    make_authority(tmp_path)
    edge, car = make_peer(tmp_path, "edge1", "edge"), make_peer(tmp_path, "car1", "car")
    older = car.rename(tmp_path / "car1.old")
    renewed = make_peer(tmp_path, "car1", "car")
    assert meet(older, edge) == meet(renewed, edge) == (Peer("car1", "car"), Peer("edge1", "edge"))
    assert older.read_bytes() != renewed.read_bytes()


def meet(dials: Path, listens: Path) -> tuple[Peer, Peer]:
    """Whom the listener and the dialler have seen after a handshake in memory. Raises ssl.SSLError."""
    there, back = ssl.MemoryBIO(), ssl.MemoryBIO()
    dialler = Credentials(str(dials)).dialling.wrap_bio(back, there)
    listener = Credentials(str(listens)).listening.wrap_bio(there, back, server_side=True)
    for side in (dialler, listener, dialler, listener):
        with contextlib.suppress(ssl.SSLWantReadError):
            side.do_handshake()
    return identity(listener.getpeercert() or {}), identity(dialler.getpeercert() or {})
