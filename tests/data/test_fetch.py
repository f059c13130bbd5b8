"""Files are taken from a server that may stop, lie, or be somebody else: whole and checked, or not
at all.
"""

from __future__ import annotations

import contextlib
import hashlib
import random
import stat
import sys
import threading
import zipfile
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest

from genie_sim.base.errors import UserError
from genie_sim.data import fetch
from tests.data.archives import archive

CONTENT = bytes(range(256)) * 4000
SHA256 = hashlib.sha256(CONTENT).hexdigest()


class Server:
    """A local server. ``files`` by path; ``manner`` says how it behaves."""

    def __init__(self):
        self.files: dict[str, bytes] = {}
        self.manner = "well"
        self.requests = 0
        self.is_given_up = threading.Event()
        server = self

        class Handler(BaseHTTPRequestHandler):
            protocol_version = "HTTP/1.1"

            def do_GET(self):
                server.answer(self)

            def log_message(self, *arguments):
                pass

        self.http = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self.base = f"http://127.0.0.1:{self.http.server_port}"
        threading.Thread(target=self.http.serve_forever, args=(0.01,), daemon=True).start()

    def answer(self, request):
        self.requests += 1
        body = self.files.get(request.path)
        if body is None or self.manner == "broken":
            request.send_error(404 if body is None else 503)
            return
        request.send_response(200)
        claimed = 10**12 if self.manner == "claims too much" else len(body)
        if self.manner != "endless":
            request.send_header("Content-Length", str(claimed))
        request.send_header("Connection", "close")
        request.end_headers()
        request.close_connection = True
        if self.manner == "stops halfway":
            body = body[: len(body) // 2]
        if self.manner == "stalls":
            request.wfile.write(body[:1000])
            request.wfile.flush()
            self.is_given_up.wait(60)
            return
        with contextlib.suppress(OSError):
            request.wfile.write(body)
            while self.manner == "endless":
                request.wfile.write(body)


@pytest.fixture
def server(monkeypatch):
    made = Server()
    monkeypatch.setattr(fetch, "TIMEOUT_S", 0.3)
    yield made
    made.is_given_up.set()
    made.http.shutdown()
    made.http.server_close()


@pytest.fixture
def nano(server, monkeypatch):
    monkeypatch.setitem(fetch.MODELS, "yolox-nano", (len(CONTENT), SHA256))
    monkeypatch.setattr(fetch.fetch_model, "__defaults__", (server.base,))
    server.files["/yolox_nano.onnx"] = CONTENT


def quiet(done, total, what):
    assert done <= total


def link(name):
    entry = zipfile.ZipInfo(name)
    entry.external_attr = (stat.S_IFLNK | 0o777) << 16
    return entry


def test_a_model_is_fetched_once(server, nano, tmp_path):
    steps = []
    path = fetch.fetch_model(
        "yolox_nano", tmp_path, lambda done, total, what: steps.append((done, total))
    )
    assert path.read_bytes() == CONTENT
    assert steps[-1] == (len(CONTENT), len(CONTENT))
    fetch.fetch_model("yolox-nano", tmp_path, quiet)
    assert server.requests == 1
    assert [entry.name for entry in tmp_path.iterdir()] == ["yolox_nano.onnx"]


@pytest.mark.parametrize(
    ("manner", "reason"),
    [
        ("stops halfway", "IncompleteRead"),
        ("claims too much", r"more than 1,024,000 bytes: another file"),
        ("endless", r"more than 1,024,000 bytes: another file"),
        ("stalls", "timed out"),
        ("broken", "503"),
    ],
)
def test_of_a_file_that_does_not_come_whole_nothing_is_left(
    *, server, nano, tmp_path, manner, reason
):
    server.manner = manner
    with pytest.raises(UserError, match=rf"/yolox_nano.onnx: .*{reason}") as error:
        fetch.fetch_model("yolox-nano", tmp_path, quiet)
    assert "\n" not in str(error.value) and not list(tmp_path.iterdir())


def test_corrupted_bytes_are_thrown_away(server, nano, tmp_path):
    server.files["/yolox_nano.onnx"] = CONTENT[:-1] + b"?"
    with pytest.raises(UserError, match=r"yolox_nano.onnx: .*to do it by hand.*hash") as error:
        fetch.fetch_model("yolox-nano", tmp_path, quiet)
    assert "\n" not in str(error.value) and not list(tmp_path.iterdir())


def test_one_line_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pooch", None)
    with pytest.raises(UserError, match=r"^import fetch: .*pip install 'genie-sim\[fetch\]'$"):
        fetch.fetch_drive(DRIVE, tmp_path, quiet)


def test_other_content_in_the_way_stays(server, nano, tmp_path):
    path = tmp_path / "yolox_nano.onnx"
    path.write_bytes(b"mine")
    with pytest.raises(UserError, match=r"yolox_nano.onnx: is there already") as error:
        fetch.fetch_model("yolox-nano", tmp_path, quiet)
    assert "\n" not in str(error.value)
    assert path.read_bytes() == b"mine" and server.requests == 0


def test_a_folder_in_the_way_stays(server, nano, tmp_path):
    (tmp_path / "yolox_nano.onnx").mkdir()
    with pytest.raises(UserError, match=r"yolox_nano.onnx: cannot be written"):
        fetch.fetch_model("yolox-nano", tmp_path, quiet)
    assert (tmp_path / "yolox_nano.onnx").is_dir() and server.requests == 0


def test_without_a_network_one_line_says_what_to_do(server, nano, tmp_path):
    server.http.shutdown()
    server.http.server_close()
    with pytest.raises(
        UserError, match=r"yolox_nano.onnx: not received; to do it by hand, .*: "
    ) as error:
        fetch.fetch_model("yolox-nano", tmp_path, quiet)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("what", "name", "message"),
    [
        ("modell", "x", "kind of thing to fetch 'modell' (did you mean 'model'?)"),
        ("model", "yolox-nan", "unknown model 'yolox-nan' (did you mean 'yolox-nano'?)"),
        ("drive", "../../etc", "drive '../../etc': must be a raw drive"),
        ("drive", "odometry/05", "drive 'odometry/05': only raw drives"),
    ],
)
def test_unknown_names_are_refused_before_the_network(run_cli, what, name, message):
    wrong = run_cli("import", "fetch", what, name)
    assert wrong.returncode == 1
    assert message in wrong.stderr and wrong.stderr.count("\n") == 1


DRIVE = "2011_09_26_drive_0005"


@pytest.fixture
def drive(server):
    folder = f"2011_09_26/{DRIVE}_sync"
    server.files["/2011_09_26_calib.zip"] = archive(
        [("2011_09_26/calib_cam_to_cam.txt", "P_rect_02: 1")]
    )
    server.files[f"/{DRIVE}/{DRIVE}_tracklets.zip"] = archive(
        [(f"{folder}/tracklet_labels.xml", "<x/>")]
    )
    server.files[f"/{DRIVE}/{DRIVE}_sync.zip"] = archive(
        [(f"{folder}/oxts/data/0000000000.txt", "49.0")]
    )
    return server


def test_a_drive_is_unpacked_into_kitti_s_layout(drive, tmp_path):
    root = fetch.fetch_drive("2011_09_26/0005", tmp_path / "kitti", quiet, drive.base)
    files = sorted(path.relative_to(root).as_posix() for path in root.rglob("*") if path.is_file())
    assert files == [
        "2011_09_26/2011_09_26_drive_0005_sync/oxts/data/0000000000.txt",
        "2011_09_26/2011_09_26_drive_0005_sync/tracklet_labels.xml",
        "2011_09_26/calib_cam_to_cam.txt",
    ]


def test_a_drive_without_tracklets_is_complete(drive, tmp_path):
    del drive.files[f"/{DRIVE}/{DRIVE}_tracklets.zip"]
    root = fetch.fetch_drive(f"{DRIVE}_sync", tmp_path, quiet, drive.base)
    assert len(list(root.rglob("*.txt"))) == 2


def test_a_drive_that_does_not_exist(drive, tmp_path):
    with pytest.raises(UserError, match=r"2011_09_26_drive_0099_sync.zip: not received.*404"):
        fetch.fetch_drive("2011_09_26_drive_0099", tmp_path, quiet, drive.base)


@pytest.mark.parametrize(
    ("entries", "message"),
    [
        ([("../evil.txt", "x")], "leads out of the folder"),
        ([("ok.txt", "x"), ("a/../../evil.txt", "x")], "leads out of the folder"),
        ([("/etc/evil.txt", "x")], "leads out of the folder"),
        ([("link/evil.txt", "x")], "leads out of the folder"),
        ([(link("way_out"), "/etc")], "is a link or a device"),
        ([("ok.txt", "x"), ("f", "x"), ("f/g", "y")], "cannot be unpacked"),
        ([("ok.txt", "x"), ("kept", "y")], "'kept' is a file where a folder is"),
        ([("ok.txt", "x"), ("kept/a.txt/b", "y")], "'kept/a.txt/b' is a file where a folder is"),
        ([("ok.txt", "x"), ("kept/a.txt", "y")], "kept/a.txt: is there already"),
        ([("bomb.txt", b"\0" * 10**7)], "unpacks to 10,000,000 bytes from"),
        ([("ok.txt", "x"), ("a.txt", "y"), ("./ok.txt", "z")], "'./ok.txt' is there twice"),
        ([("Q", "x")], "'' is no name of a file"),
        ([(".", "x")], "is no name of a file"),
        ([(f"{i}.txt", b"\0" * 250_000) for i in range(40)], "unpacks to 10,000,000 bytes from"),
        ([(f"{i}.txt", "") for i in range(1001)], "has 1,001 files, more than 1,000"),
        (
            [("big1.bin", bytes(range(256)) * 3000), ("big2.bin", bytes(range(255)) * 3000)],
            "more than 1,000,000",
        ),
    ],
)
def test_a_hostile_archive_writes_nothing(tmp_path, monkeypatch, entries, message):
    monkeypatch.setattr(fetch, "MAX_ENTRIES", 1000)
    if "more than" in message:
        monkeypatch.setattr(fetch, "MAX_UNPACKED_BYTES", 10**6)
    folder, outside = tmp_path / "in" / "kitti", tmp_path / "in" / "outside"
    folder.mkdir(parents=True)
    outside.mkdir()
    (folder / "link").symlink_to(outside)
    (folder / "kept").mkdir()
    (folder / "kept" / "a.txt").write_text("mine")
    packed = tmp_path / "x.zip"
    packed.write_bytes(archive(entries).replace(b"Q", b"\0"))  # a name ends at its first zero
    with pytest.raises(UserError, match=message) as error:
        fetch.unpack(packed, folder)
    assert "\n" not in str(error.value)
    assert sorted(path.name for path in folder.rglob("*")) == ["a.txt", "kept", "link"]
    assert not list(outside.iterdir()) and (folder / "kept" / "a.txt").read_text() == "mine"
    assert not list((tmp_path / "in").glob("evil*"))


def test_an_encrypted_archive_writes_nothing(tmp_path):
    whole = bytearray(archive([("a.txt", "x")]))
    whole[whole.index(b"PK\x01\x02") + 8] |= 1  # the flag in the archive's directory
    (tmp_path / "x.zip").write_bytes(whole)
    with pytest.raises(UserError, match=r"x.zip: not a readable ZIP archive: .*encrypted"):
        fetch.unpack(tmp_path / "x.zip", tmp_path / "out")
    assert not list((tmp_path / "out").iterdir())


def test_an_archive_cut_short_or_changed_is_refused(tmp_path):
    whole = archive([(f"{i}.bin", bytes(range(256)) * 40) for i in range(4)])
    for number, content in enumerate(
        [b"", b"<html>", whole[:-10], whole[: len(whole) // 2], whole[:-600] + b"xx" + whole[-598:]]
    ):
        packed = tmp_path / f"{number}.zip"
        packed.write_bytes(content)
        with pytest.raises(UserError, match=rf"{number}.zip: not a readable ZIP archive"):
            fetch.unpack(packed, tmp_path / "out")
        assert not any((tmp_path / "out").glob("*"))


@pytest.mark.parametrize("method", [zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_what_unpacks_without_a_bound_is_refused(tmp_path, method):
    """A thousand bytes of them fill gigabytes of memory, whatever size the archive gives."""
    packed = tmp_path / "x.zip"
    with zipfile.ZipFile(packed, "w", method) as archive_file:
        archive_file.writestr("a.txt", "x")
    with pytest.raises(UserError, match=r"x.zip: 'a.txt' is neither stored nor deflated"):
        fetch.unpack(packed, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_broken_entry_is_told_in_one_line(tmp_path):
    """Random bytes of the compressed entry, or of anything in the archive, are changed."""
    packed, content = tmp_path / "x.zip", random.Random(0).randbytes(500)
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive_file:
        archive_file.writestr("a.bin", content)
    whole = packed.read_bytes()
    refusals = 0
    for seed in range(200):
        source, damaged = random.Random(seed), bytearray(whole)
        first = source.choice((0, 30))
        for _ in range(3):
            damaged[source.randrange(first, len(damaged))] ^= source.randrange(1, 256)
        packed.write_bytes(damaged)
        try:
            fetch.unpack(packed, tmp_path / "out")
        except UserError as error:
            assert str(error).startswith(f"{packed}: ") and "\n" not in str(error)
            refusals += 1
    assert refusals > 150
