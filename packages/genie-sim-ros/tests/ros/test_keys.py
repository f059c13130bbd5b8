"""Keys made by the commands of ``docs/keys.md``, and plans of links: what is wrong with them
is told before a node is touched.
"""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import pytest

from genie_sim.base.errors import UserError
from genie_sim_ros.keys import check_keys, key_files
from genie_sim_ros.plan import AttachPlan, check
from tests.ros.conftest import Keys


@pytest.fixture
def folder(keys: Keys, tmp_path: Path) -> Path:
    """The keys of car1, in a folder of its own."""
    for path in key_files(Path(keys("car1")), "car1"):
        shutil.copy(path, tmp_path)
    return tmp_path


def refusal(folder: Path, name: str = "car1") -> str:
    """The one line with which a folder of keys is refused."""
    with pytest.raises(UserError) as raised:
        check_keys(folder, name)
    (line,) = str(raised.value).splitlines()
    return line


def test_the_keys_of_the_page_are_right_and_private(folder: Path, keys: Keys):
    check_keys(folder, "car1")
    made = Path(keys("edge1"))
    check_keys(made, "edge1")
    assert {path.stat().st_mode & 0o777 for path in made.glob("*.key")} == {0o600}


@pytest.mark.parametrize("file", ["ca.pem", "car1.pem", "car1.key"])
def test_a_file_that_is_missing_or_broken_is_named(folder: Path, file: str):
    path = folder / file
    whole = path.read_bytes()
    for broken in (b"", b"\xff", whole.replace(b"M", b"N", 3)):
        path.write_bytes(broken)
        assert str(path) in refusal(folder)
    path.unlink()
    assert refusal(folder) == f"{path}: No such file or directory"
    path.mkdir()
    assert refusal(folder) == f"{path}: Is a directory"


def test_a_key_that_others_may_read_is_refused(folder: Path):
    key = folder / "car1.key"
    key.chmod(0o640)
    assert refusal(folder) == f"{key}: others may read it; chmod 600 {key}"


def test_a_key_with_a_password_is_refused_and_not_asked_for(folder: Path, keys: Keys):
    key = folder / "car1.key"
    keys.run(f"openssl ec -aes256 -passout pass:secret -in {key} -out {key}", folder)
    assert f"no PEM certificate of the key {key}" in refusal(folder)


def test_a_certificate_that_nobody_would_accept_is_refused(folder: Path, keys: Keys):
    certificate, authority = folder / "car1.pem", folder / "ca.pem"
    mine = authority.read_bytes()
    authority.write_bytes(Path(keys("x", "others"), "ca.pem").read_bytes())
    line = refusal(folder)
    assert line.startswith(f"{certificate}: ") and line.endswith(f"(authority: {authority})")
    assert "certificate" in line.removeprefix(f"{certificate}: ")
    authority.write_bytes(mine)
    certificate.write_bytes(Path(keys("car2"), "car2.pem").read_bytes())
    assert "key values mismatch" in refusal(folder)
    expired = Path(keys("expired", days=-1))
    assert f"{expired}/expired.pem: certificate has expired" in refusal(expired, "expired")


def test_a_certificate_of_another_name_is_refused(folder: Path):
    for suffix in ("pem", "key"):
        shutil.copy(folder / f"car1.{suffix}", folder / f"car2.{suffix}")
    assert refusal(folder, "car2") == (
        f"{folder}/car2.pem: its common name is 'car1'; this Genie is car2"
    )


def plan(**fields: Any) -> AttachPlan:
    return AttachPlan(
        **{"node": "/n", "name": "edge1", "role": "edge", "requests": (), "answers": (), **fields}
    )


LISTENS = {"listen": "h:1", "cars": ("car1",)}


@pytest.mark.parametrize(
    ("fields", "line"),
    [
        ({**LISTENS, "role": "car"}, "a car connects to its edge and does not listen"),
        ({"cars": ("car1",)}, "--car and --edge name who may connect; say where: --listen"),
        ({"listen": "h:1"}, "--listen: nobody may connect; name those who may: --car, --edge"),
        ({**LISTENS, "edges": ("car1",)}, "car1 cannot be a car and an edge"),
        ({**LISTENS, "cars": ("edge1",)}, "this Genie and another one are both called edge1"),
        ({**LISTENS, "cars": ("car 1",)}, "'car 1' is no name of a Genie"),
        ({**LISTENS, "cars": ("*",)}, "'*' is no name of a Genie"),
        ({**LISTENS, "cars": ("a.b",)}, "'a.b' is no name of a Genie"),
        ({**LISTENS, "name": "a" * 65}, "is no name of a Genie"),
        ({"connect": ("h:1",)}, "'h:1' does not say whom to connect to; write name@host:port"),
        ({"connect": ("@h:1",)}, "'' is no name of a Genie"),
        (LISTENS, "a link to another Genie needs a folder of keys: --keys"),
        *(
            ({**LISTENS, "listen": address}, "is no address; write host:port")
            for address in ("h", "h:", "h:65536", "h:123456", "h:-1", "h:٣", "h#x=1:1", "a b:1")
        ),
    ],
)
def test_a_plan_that_makes_no_link_is_refused(fields: dict[str, Any], line: str):
    with pytest.raises(UserError) as raised:
        check(plan(**fields))
    assert str(raised.value).startswith("link: ") and line in str(raised.value)


@pytest.mark.parametrize("address", ["192.168.0.7:0", "[::1]:65535", "edge1.local:7411"])
def test_addresses(keys: Keys, address: str):
    check(plan(listen=address, cars=("car1",), connect=(f"edge2@{address}",), keys=keys("edge1")))
