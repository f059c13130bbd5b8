"""Scenarios, device profiles and traces are found by path or by name; what a stranger wrote is read
with care.
"""

from __future__ import annotations

import os
from pathlib import Path
from threading import Event, Thread

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from genie_sim.base import files
from genie_sim.base.errors import UserError, as_user_error
from genie_sim.base.paths import MAX_TEXT_BYTES, atomic_write, locked, read_text, remembered
from genie_sim.record.folders import result_folder
from genie_sim.scenario.yaml_input import dump, parse, read_mapping


def refusal(data: bytes, tmp_path: Path) -> str:
    """What ``read_mapping`` says of a file with these bytes, without the folder's name."""
    path = tmp_path / "x.yaml"
    path.write_bytes(data)
    with pytest.raises(UserError) as error:
        read_mapping(path)
    assert "\n" not in str(error.value)
    return str(error.value).replace(f"{tmp_path}/", "")


def test_a_text_that_would_fill_the_memory_is_refused(tmp_path):
    """Its size counts, which costs no room on the disk."""
    path = tmp_path / "run.json"
    with path.open("wb") as file:
        file.truncate(MAX_TEXT_BYTES + 1)
    with pytest.raises(UserError, match=r"run\.json: cannot be read: .* bytes, more than"):
        read_text(path)
    file = tmp_path / "pipe.json"
    os.mkfifo(file)
    with pytest.raises(UserError, match="not a regular file"):
        read_text(file)


def test_what_a_library_says_is_told_in_one_line_of_so_many_letters() -> None:
    with (
        pytest.raises(UserError, match=r"^x\.bag: broken: abc$"),
        as_user_error("x.bag: broken", ValueError, most=3),
    ):
        raise ValueError("abcdef\nand more")
    with (
        pytest.raises(UserError, match=r"^x: No such file or directory$"),
        as_user_error("x", OSError),
    ):
        Path("nowhere").read_bytes()
    with pytest.raises(KeyError), as_user_error("x", ValueError):
        raise KeyError("another kind is nobody's input")


def test_a_shipped_file_is_found_by_name_from_any_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert files.find(files.SCENARIO, "street_3car_hetero").name == "street_3car_hetero.yaml"
    assert files.find(files.DEVICE, "jetson_tx2").name == "jetson_tx2.yaml"


def test_the_current_folder_comes_before_the_shipped_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    own = tmp_path / "device_profiles" / "jetson_tx2.yaml"
    own.parent.mkdir()
    own.touch()
    monkeypatch.chdir(tmp_path)
    assert files.find(files.DEVICE, "jetson_tx2").resolve() == own
    assert "agx_xavier" in files.available(files.DEVICE)


def test_a_path_is_taken_as_it_stands(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "mine.yaml").touch()
    monkeypatch.chdir(tmp_path)
    for path in ("mine.yaml", "./mine.yaml", str(tmp_path / "mine.yaml"), tmp_path / "mine.yaml"):
        assert files.find(files.SCENARIO, path).resolve() == tmp_path / "mine.yaml"
    (tmp_path / "folder").mkdir()
    (tmp_path / "folder" / "mine").touch()
    assert files.find(files.SCENARIO, "folder/mine") == Path("folder/mine")


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("nowhere/x.yaml", "nowhere/x.yaml: no such file"),
        ("x.yaml", "x.yaml: no such file"),
        ("folder/", "unknown trace 'folder/'"),
        ("./folder.d", "./folder.d: is a folder, not a file"),
        ("./pipe.yaml", "./pipe.yaml: is a device or a pipe"),
        ("x" * 300 + ".yaml", "x" * 300 + ".yaml: File name too long"),
        ("kitty", "unknown trace 'kitty' (did you mean 'kitti'?)"),
        ("", "unknown trace ''"),
        ("~nobody-lives-here/x.yaml", "~nobody-lives-here/x.yaml: no such file"),
        ("y" * 100, f"unknown trace '{'y' * 56}..."),
    ],
)
def test_what_is_not_there(
    name: str, message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "folder.d").mkdir()
    os.mkfifo(tmp_path / "pipe.yaml")
    (tmp_path / "scenarios/traces").mkdir(parents=True)
    (tmp_path / "scenarios/traces/kitti.parquet").touch()
    monkeypatch.chdir(tmp_path)
    with pytest.raises(UserError) as error:
        files.find(files.TRACE, name)
    assert str(error.value).startswith(message)


@pytest.mark.parametrize(
    ("data", "place"),
    [
        (b"", "is empty"),
        (b"- a\n- b\n", "is a list"),
        (b"hello\n", "is the single value 'hello'"),
        (b"a: 1\nb: [1\n", "line 3"),
        (b"a: 1\nb: c: d\n", "line 2"),
        (b"a: 1\nb: 2\na: 3\n", "line 3: duplicate key 'a'"),
        (b"a:\n\tb: 1\n", "line 2: a tab"),
        (b"a: 1\nb: \x00\n", "line 2"),
        (b'a: "\\0"\n', "line 1"),
        (b'a: "\\uD800"\n', "line 1"),
        (b"a: 1\nb: \xff\xfe\n", "line 2: is not UTF-8"),
        (b"1: a\n", "line 1: a key"),
        (b"a: 1\n---\nb: 1\n", "line 2"),
        (b"a: &a [*a]\n", "line 1: anchors"),
        (b"a: !!python/object/apply:os.system [ls]\n", "line 1: tags"),
        (b"a: !mine x\n", "line 1: tags"),
        (b"? [1]\n: 2\n", "line 1: a key"),
        (b"a: " + b"x" * 1_000_000, "cannot be read: 1,000,003 bytes"),
    ],
)
def test_yaml_that_is_no_scenario(data: bytes, place: str, tmp_path: Path) -> None:
    assert refusal(data, tmp_path).startswith(f"x.yaml: {place}")


def test_yaml_may_be_nested_as_deep_as_the_message_says() -> None:
    def nested(depth: int) -> str:
        return "[" * depth + "]" * depth

    parse(nested(40), "text")
    with pytest.raises(UserError, match="nested more than 40 deep"):
        parse(nested(41), "text")


def test_a_missing_file_is_told_as_such(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"gone\.yaml: cannot be read: No such file or directory"):
        read_mapping(tmp_path / "gone.yaml")


def test_no_surprises_of_old_yaml() -> None:
    text = (
        "{no: no, loss: 1e-3, camera: 02, drive: 2011_09_26, time: 1:30, day: 2011-09-26, none: ~,"
        " yes: true}"
    )
    assert parse(text, "text") == {
        "no": "no",
        "loss": 0.001,
        "camera": "02",
        "drive": "2011_09_26",
        "time": "1:30",
        "day": "2011-09-26",
        "none": None,
        "yes": True,
    }


readable = st.text(st.characters(codec="utf-8", exclude_categories=("Cc", "Cs")), max_size=30)
plain = st.none() | st.booleans() | st.integers(-(10**17), 10**17) | st.floats(1e-9, 1e9) | readable
texts = st.sampled_from(
    [
        "no",
        "1e-3",
        "02",
        "0x1",
        "1_000",
        "null",
        "~",
        "",
        "1:30",
        "2011-09-26",
        ".5",
        "=",
        "<<",
        "-",
    ]
)


@given(
    st.recursive(
        plain | texts,
        lambda inner: st.lists(inner) | st.dictionaries(readable | texts, inner),
        max_leaves=20,
    )
)
@pytest.mark.slow
def test_what_is_written_is_read_back(value: object) -> None:
    assert parse(dump(value), "text") == value


@settings(max_examples=20)
@given(st.text("[]{}&*!|>'\"%@`:,-? \n\t#ab12\0\x85\u2028é\ufeff\ud83d😀", max_size=60))
def test_whatever_is_typed_ends_in_data_or_in_one_line(text: str) -> None:
    try:
        parse(text, "text")
    except UserError as error:
        assert str(error).startswith("text: ") and "\n" not in str(error)


def test_a_file_that_is_not_there_but_comes_with_genie_sim_is_named():
    with pytest.raises(
        UserError,
        match=r"^street_3car_hetero\.yaml: no such file; "
        r"the scenario 'street_3car_hetero' needs no path$",
    ):
        files.find(files.SCENARIO, "street_3car_hetero.yaml")


def test_a_file_of_ones_own_under_a_shipped_name_is_used_and_told_once(
    caplog: pytest.LogCaptureFixture,
):
    Path("device_profiles").mkdir()
    Path("device_profiles/jetson_tx2.yaml").write_text("mine")
    files._tell_of_two.cache_clear()
    with caplog.at_level("WARNING"):
        assert {files.find(files.DEVICE, "jetson_tx2") for _ in range(3)} == {
            Path("device_profiles/jetson_tx2.yaml")
        }
    said = "device_profiles/jetson_tx2.yaml is used, not what comes with genie-sim under this name"
    assert [one.replace("\\", "/") for one in caplog.messages] == [said]


@pytest.mark.parametrize("error", [OSError(28, "No space left on device"), RuntimeError("mine")])
def test_a_file_that_is_not_finished_is_not_there(tmp_path: Path, error: Exception):
    def write() -> None:
        with atomic_write(tmp_path / "x.csv") as beside:
            beside.write_text("half")
            raise error

    with pytest.raises(
        UserError if isinstance(error, OSError) else RuntimeError, match=r"No space left|mine"
    ):
        write()
    assert not list(tmp_path.iterdir())


class DiskLog:
    """The order in which names of files are synced to the disk, and get their final names."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.events: list[tuple[str, str]] = []
        fsync, replace, rename = os.fsync, Path.replace, Path.rename

        def logged_fsync(descriptor: int) -> None:
            name = Path(f"/proc/self/fd/{descriptor}").readlink().name
            self.events.append(("sync", name))
            fsync(descriptor)

        def logged_replace(source: Path, target: Path) -> Path:
            self.events.append(("name", target.name))
            return replace(source, target)

        def logged_rename(source: Path, target: Path) -> Path:
            self.events.append(("name", target.name))
            return rename(source, target)

        monkeypatch.setattr(os, "fsync", logged_fsync)
        monkeypatch.setattr(Path, "replace", logged_replace)
        monkeypatch.setattr(Path, "rename", logged_rename)


needs_proc = pytest.mark.skipif(not Path("/proc/self/fd").is_dir(), reason="needs /proc")


@needs_proc
def test_a_file_is_on_the_disk_before_it_has_its_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    disk = DiskLog(monkeypatch)
    with atomic_write(tmp_path / "table.csv") as partial:
        partial.write_text("a,b\n")
    assert disk.events == [("sync", partial.name), ("name", "table.csv"), ("sync", tmp_path.name)]


@needs_proc
def test_all_files_of_a_result_are_on_the_disk_before_it_has_its_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    disk = DiskLog(monkeypatch)
    with result_folder(tmp_path / "run") as partial:
        (partial / "figures").mkdir()
        (partial / "figures" / "cdf.svg").write_text("<svg/>")
        (partial / "frames.parquet").write_text("frames")
    named = disk.events.index(("name", "run"))
    before = {name for _, name in disk.events[:named]}
    assert before == {"cdf.svg", "figures", "frames.parquet", partial.name}
    assert disk.events[named + 1 :] == [("sync", tmp_path.name)]


def test_a_file_that_is_as_it_was_is_not_read_again(tmp_path: Path) -> None:
    reads = []

    @remembered
    def length(path: Path) -> int:
        reads.append(path.name)
        return len(path.read_bytes())

    first, second = tmp_path / "first", tmp_path / "second"
    first.write_bytes(b"abc")
    second.write_bytes(b"ab")
    assert [length(first), length(second), length(str(first))] == [3, 2, 3]
    assert reads == ["first", "second"]
    os.utime(first, ns=(1, 1))
    assert length(first) == 3 and len(reads) == 3, "its time tells that it was written again"
    first.write_bytes(b"abcd")
    assert length(first) == 4
    second.unlink()
    with pytest.raises(FileNotFoundError):
        length(second)


@pytest.mark.unix
def test_a_folder_is_held_by_one_and_others_wait(tmp_path):
    order, begun = [], Event()

    def second() -> None:
        begun.set()
        with locked(tmp_path):
            order.append("second")

    with locked(tmp_path):
        waiting = Thread(target=second)
        waiting.start()
        begun.wait()
        with pytest.raises(OSError), locked(tmp_path, wait=False):
            pass
        order.append("first")
    waiting.join()
    assert order == ["first", "second"]
