"""Where a result comes from: equal inputs have equal run ids, and a result folder is there whole or
not at all.
"""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from genie_sim.base.errors import UserError
from genie_sim.base.paths import usable
from genie_sim.record import folders, provenance
from genie_sim.record.folders import check_writable, result_folder
from genie_sim.record.provenance import run_id

FACTS = {
    "scenario": {"name": "street_3car_hetero", "seed": 1, "cars": [{"name": "car1"}]},
    "devices": {},
    "traces": {"car1": "ab12"},
    "methods": [],
}


def write_whole_result(final: Path, text: str = "frames") -> None:
    with result_folder(final) as partial:
        (partial / "figures").mkdir()
        (partial / "figures" / "latency_cdf.svg").write_text(text)
        (partial / "frames.parquet").write_text(text)
        (partial / "run.json").write_text("{}")


def everything_in(folder: Path) -> list[str]:
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*"))


def test_what_somebody_put_into_a_result_stays_when_it_is_made_again(tmp_path):
    """Also a link, which is not followed; what the result had written itself goes."""
    final, elsewhere = tmp_path / "run", tmp_path / "elsewhere"
    (final / "mine").mkdir(parents=True)
    elsewhere.mkdir()
    (elsewhere / "precious").write_text("precious")
    (final / "run.json").write_text("{}")
    (final / "page.html").write_text("of before")
    (final / "mine" / "notes.partial.md").write_text("mine")
    (final / ".summary.md.0123abcd.partial").write_text("half")
    (final / "link").symlink_to(elsewhere)
    with result_folder(final, ("page.html",)) as partial:
        (partial / "run.json").write_text("[]")
    assert (final / "mine" / "notes.partial.md").read_text() == "mine"
    assert not (final / ".summary.md.0123abcd.partial").exists()
    assert (final / "link").is_symlink() and (elsewhere / "precious").read_text() == "precious"
    assert (final / "run.json").read_text() == "[]" and not (final / "page.html").exists()


def test_a_run_id_does_not_depend_on_the_order_of_settings():
    turned_round = {key: FACTS[key] for key in reversed(FACTS)}
    assert run_id(FACTS) == run_id(turned_round)
    assert len(run_id(FACTS)) == 12 and int(run_id(FACTS), 16) >= 0


@pytest.mark.parametrize(
    "other",
    [
        FACTS | {"traces": {"car1": "ab13"}},
        FACTS | {"scenario": FACTS["scenario"] | {"seed": 2}},
        FACTS | {"scenario": FACTS["scenario"] | {"cars": [{"name": "car1"}, {"name": "car2"}]}},
        FACTS | {"genie_sim": "0.2.0"},
    ],
    ids=["trace", "seed", "cars", "version"],
)
def test_whatever_decides_the_outcome_changes_the_run_id(other):
    assert run_id(other) != run_id(FACTS)


def test_not_a_number_has_no_run_id():
    with pytest.raises(ValueError):
        run_id({"rate": float("nan")})


def test_a_result_appears_once_it_is_complete(tmp_path):
    final = tmp_path / "results" / "street_3car_hetero-0123456789ab"
    with result_folder(final) as partial:
        (partial / "frames.parquet").write_text("frames")
        assert not final.exists()
    assert everything_in(tmp_path / "results") == [final.name, f"{final.name}/frames.parquet"]


@pytest.mark.parametrize("fault", [KeyboardInterrupt, RuntimeError, MemoryError])
def test_an_interrupted_run_leaves_nothing_behind(tmp_path, fault):
    with pytest.raises(fault), result_folder(tmp_path / "run") as partial:
        (partial / "frames.parquet").write_text("half")
        raise fault
    assert everything_in(tmp_path) == []


def test_an_interrupted_run_leaves_the_earlier_result_as_it_was(tmp_path):
    final = tmp_path / "run"
    write_whole_result(final, "earlier")
    before = everything_in(tmp_path)
    with pytest.raises(KeyboardInterrupt), result_folder(final) as partial:
        (partial / "frames.parquet").write_text("half")
        raise KeyboardInterrupt
    assert everything_in(tmp_path) == before
    assert (final / "frames.parquet").read_text() == "earlier"


@pytest.mark.unix
def test_ctrl_c_waits_until_a_result_is_in_its_place(tmp_path, monkeypatch):
    """And until what is half done is cleared away; the line says whether results are kept."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    rename, rmtree = Path.rename, shutil.rmtree

    def interrupting(call):
        def interrupted(*given, **more):
            signal.raise_signal(signal.SIGINT)
            return call(*given, **more)

        return interrupted

    try:
        monkeypatch.setattr(Path, "rename", interrupting(rename))
        with pytest.raises(KeyboardInterrupt, match="the results are kept in"):
            write_whole_result(tmp_path / "run", "whole")
        monkeypatch.setattr(Path, "rename", rename)
        monkeypatch.setattr(shutil, "rmtree", interrupting(rmtree))
        with pytest.raises(KeyboardInterrupt), result_folder(tmp_path / "half") as partial:
            (partial / "frames.parquet").write_text("half")
            raise RuntimeError
    finally:
        signal.signal(signal.SIGINT, before)
        monkeypatch.undo()
    files = ["figures", "figures/latency_cdf.svg", "frames.parquet", "run.json"]
    assert everything_in(tmp_path) == ["run", *(f"run/{name}" for name in files)]


def test_a_result_of_the_same_run_is_replaced(tmp_path):
    final = tmp_path / "run"
    write_whole_result(final, "earlier")
    write_whole_result(final, "later")
    files = ["figures", "figures/latency_cdf.svg", "frames.parquet", "run.json"]
    assert everything_in(tmp_path) == ["run", *(f"run/{name}" for name in files)]
    assert (final / "frames.parquet").read_text() == "later"


def test_a_result_that_cannot_be_replaced_is_still_there(tmp_path, monkeypatch):
    """Ctrl-C at the worst moment: the earlier result has just made room for the new one."""
    final = tmp_path / "run"
    write_whole_result(final, "earlier")
    before = everything_in(tmp_path)
    rename = Path.rename

    def interrupted_once(path: Path, target: Path) -> Path:
        if target == final:
            monkeypatch.setattr(Path, "rename", rename)
            raise KeyboardInterrupt
        return rename(path, target)

    monkeypatch.setattr(Path, "rename", interrupted_once)
    with pytest.raises(KeyboardInterrupt):
        write_whole_result(final, "later")
    assert everything_in(tmp_path) == before
    assert (final / "frames.parquet").read_text() == "earlier"


@pytest.mark.parametrize("place", ["thesis", "thesis/chapter.txt", "."])
def test_what_is_no_result_is_never_replaced(tmp_path, monkeypatch, place):
    (tmp_path / "thesis").mkdir()
    (tmp_path / "thesis" / "chapter.txt").write_text("years of work")
    monkeypatch.chdir(tmp_path)
    with (
        pytest.raises(UserError, match="contains files that are not a genie-sim result"),
        result_folder(Path(place)),
    ):
        raise AssertionError("nothing is simulated")
    assert everything_in(tmp_path) == ["thesis", "thesis/chapter.txt"]


def test_an_empty_folder_becomes_a_result(tmp_path):
    (tmp_path / "run").mkdir()
    write_whole_result(tmp_path / "run")
    assert (tmp_path / "run" / "run.json").is_file()


def test_a_full_disk_is_one_line_and_no_half_result(tmp_path):
    with (
        pytest.raises(UserError, match="No space left") as caught,
        result_folder(tmp_path / "run") as partial,
    ):
        (partial / "frames.parquet").write_text("half")
        with usable(partial / "frames.parquet"):
            raise OSError(28, "No space left on device")
    assert str(tmp_path / "run") in str(caught.value) and "\n" not in str(caught.value)
    assert everything_in(tmp_path) == []


def test_the_place_for_results_is_checked_before_simulating(tmp_path):
    check_writable(tmp_path / "not" / "yet" / "there")
    assert everything_in(tmp_path) == []
    (tmp_path / "file").write_text("not a folder")
    too_long = tmp_path / ("x" * 300)
    for out in (tmp_path / "file", tmp_path / "file" / "results", too_long):
        with pytest.raises(UserError, match="no results can be written there") as caught:
            check_writable(out)
        assert str(out) in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.unix
@pytest.mark.skipif(
    hasattr(os, "geteuid") and os.geteuid() == 0, reason="root may write everywhere"
)
def test_a_folder_without_permission_is_found_before_simulating(tmp_path):
    tmp_path.chmod(0o555)
    try:
        with pytest.raises(UserError, match="Permission denied"):
            check_writable(tmp_path / "results")
    finally:
        tmp_path.chmod(0o755)


def test_digests_tell_whether_a_table_was_changed(tmp_path):
    names = ("frames.parquet", "truth.parquet")
    for name in names:
        (tmp_path / name).write_bytes(b"rows of " + name.encode())
    before = provenance.digests(tmp_path, names)
    assert set(before) == set(names)
    provenance.check_unchanged(tmp_path, {"digests": before}, names)
    (tmp_path / "frames.parquet").write_bytes(b"other rows")
    with pytest.raises(UserError, match=r"written: frames\.parquet;"):
        provenance.check_unchanged(tmp_path, {"digests": before}, names)
    with pytest.raises(UserError, match=r"frames\.parquet, truth\.parquet"):
        provenance.check_unchanged(tmp_path, {}, names)


def test_the_environment_is_told_but_decides_nothing():
    environment = provenance.environment()
    assert environment["packages"]["simpy"] and environment["python"]
    json.dumps(environment)  # it goes into run.json


def test_run_json_comes_back_and_anything_else_is_named(tmp_path):
    facts = FACTS | {"methods": [{"name": "genie", "title": "Genie", "baseline": False}]}
    made = {"format": provenance.RESULT_FORMAT, "facts": facts, "run_id": run_id(facts)}
    made |= {"metrics": {}, "rows": {}}
    provenance.write_json(tmp_path / "run.json", made)
    assert provenance.read_run_json(tmp_path) == made
    with pytest.raises(UserError, match=r"elsewhere: .* does not exist"):
        provenance.read_run_json(tmp_path / "elsewhere")
    (tmp_path / "empty").mkdir()
    with pytest.raises(UserError, match=r"empty: .* no run\.json"):
        provenance.read_run_json(tmp_path / "empty")
    (tmp_path / "run.json").write_text('{"format": 1}')
    with pytest.raises(UserError, match=r"made by an older genie-sim: format 1, .*; run it again"):
        provenance.read_run_json(tmp_path)
    for wrong in ("{half", "[]", '{"format": 999}', "[" * 100_000):
        (tmp_path / "run.json").write_text(wrong)
        with pytest.raises(UserError, match=r"run\.json") as caught:
            provenance.read_run_json(tmp_path)
        assert "\n" not in str(caught.value)


# Folders of processes that were killed

KILLED = """
import os, signal, sys
from pathlib import Path
from genie_sim.record import folders

final, when = Path(sys.argv[1]), sys.argv[2]
rename = Path.rename

def die(*_, **__):
    os.kill(os.getpid(), signal.SIGKILL)

def renamed(self, target):
    if when == "before the rename" and folders.EARLIER not in str(target):
        die()
    return rename(self, target)

Path.rename = renamed
if when == "before the earlier goes":
    folders.shutil.rmtree = die
with folders.result_folder(final) as partial:
    (partial / "frames.parquet").write_text("new")
    (partial / "run.json").write_text("{}")
    print("began", flush=True)
    if when == "half done":
        sys.stdin.read()
"""


def killed_process(final: Path, when: str) -> subprocess.Popen[str]:
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    made = subprocess.Popen(
        [sys.executable, "-c", KILLED, final, when],
        env=environment,
        text=True,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
    )
    assert made.stdout is not None and made.stdout.readline() == "began\n"
    return made


@pytest.mark.process
@pytest.mark.unix
def test_what_a_killed_process_left_goes_and_what_a_living_one_makes_stays(tmp_path: Path):
    killed, living = (
        killed_process(tmp_path / "a", "half done"),
        killed_process(tmp_path / "b", "half done"),
    )
    (tmp_path / ".mine.01234567").mkdir()  # no name of ours
    killed.kill()
    killed.wait()
    assert len(everything_in(tmp_path)) == 7
    write_whole_result(tmp_path / "c")
    left = {name.partition("/")[0] for name in everything_in(tmp_path)}
    assert "c" in left and ".mine.01234567" in left
    assert [name.startswith(".b.") for name in left - {"c", ".mine.01234567"}] == [True], (
        "it is being made"
    )
    living.communicate("")
    assert (tmp_path / "b" / "frames.parquet").read_text() == "new" and not list(
        tmp_path.glob(".b.*")
    )


@pytest.mark.process
@pytest.mark.unix
@pytest.mark.parametrize(
    ("when", "text"), [("before the rename", "earlier"), ("before the earlier goes", "new")]
)
def test_a_kill_while_a_result_is_replaced_loses_none(tmp_path: Path, when: str, text: str):
    final = tmp_path / "run"
    write_whole_result(final, "earlier")
    assert killed_process(final, when).wait() == -9
    assert list(tmp_path.glob(f".run.*{folders.EARLIER}")), "killed in the midst of it"
    write_whole_result(tmp_path / "other")
    assert (final / "frames.parquet").read_text() == text
    assert sorted(path.name for path in tmp_path.iterdir()) == ["other", "run"]


def test_a_folder_of_several_runs_says_where_they_are(tmp_path: Path):
    run = tmp_path / "runs" / "seed-1"
    run.mkdir(parents=True)
    with pytest.raises(UserError, match=r"it has no run\.json$"):
        provenance.read_run_json(tmp_path)
    (run / "run.json").touch()
    for folder in (tmp_path, run.parent):
        with pytest.raises(UserError, match=r"it has no run\.json; .*runs/seed-1 is one$"):
            provenance.read_run_json(folder)
