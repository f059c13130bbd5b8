"""``genie-sim keys``: an authority, and key files that say who is who."""

from __future__ import annotations

from pathlib import Path

import pytest

from genie_sim.cli import main
from genie_sim.ros.certificates import Credentials
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


def test_a_peer_s_file_says_who_it_is_and_is_private(folder: Path, capsys: pytest.CaptureFixture[str]):
    for name, role in (("car1", "car"), ("edge-1.b", "edge")):
        assert main(["keys", "peer", name, "--role", role, "--ca", str(folder)]) == 0
        path = Path(capsys.readouterr().out.strip())
        assert path == folder / f"{name}.pem" and Credentials(str(path)).owner == Peer(name, role)
    assert {path.stat().st_mode & 0o777 for path in folder.iterdir()} == {0o600} and folder.stat().st_mode & 0o077 == 0
    text = (folder / "car1.pem").read_text()
    assert text.count("PRIVATE KEY") == 2, "its own: the authority's stays where it is"
    assert (folder / "authority.pem").read_text().split("-----BEGIN CERT")[0] not in text


def test_what_makes_no_key_is_said_in_a_line(folder: Path, capsys: pytest.CaptureFixture[str], tmp_path: Path):
    ca = ("--ca", str(folder))
    assert "authority.pem: is there already" in refused(capsys, "ca", str(folder))
    assert "unknown role 'bus'" in refused(capsys, "peer", "car1", "--role", "bus", *ca)
    for name in ("../x", "car 1", "", "a" * 65, "authority", "car1\nURI:genie:edge/x", "-x/y"):
        assert "is no name of a Genie" in refused(capsys, "peer", "--role", "car", *ca, "--", name)
    assert "0 days; from 1 to 36500" in refused(capsys, "peer", "car1", "--role", "car", "--days", "0", *ca)
    assert "no such file; make it: genie-sim keys ca" in refused(
        capsys, "peer", "car1", "--role", "car", "--ca", str(tmp_path / "nowhere")
    )
    assert main(["keys", "peer", "car1", "--role", "car", *ca]) == 0
    assert "car1.pem: is there already" in refused(capsys, "peer", "car1", "--role", "edge", *ca)


def test_without_openssl_it_says_so(capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    assert "no program 'openssl' here" in refused(capsys, "ca", str(tmp_path / "keys"))
