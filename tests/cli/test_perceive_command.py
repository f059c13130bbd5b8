"""Options of ``genie-sim perceive`` and ``truth``: what they ask of perception, and what does not
go together.
"""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from genie_sim.base import files
from genie_sim.cli import perceive as cli_perceive
from genie_sim.cli.main import main
from genie_sim.data import intake, trace, truth
from genie_sim.data.kitti import drive_truth, perceive

DRIVE = ["perceive", "--drive", "2011_09_26/0005"]


class Trace:
    """A trace of three frames."""

    digest = "0123456789abcdef"
    by_picture = {  # noqa: RUF012 - never changed
        ("02", 0): SimpleNamespace(detections=(1, 2)),
        ("02", 1): SimpleNamespace(detections=()),
        ("03", 0): SimpleNamespace(detections=(3,)),
    }


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """What perception is asked for, by name."""
    told: dict[str, Any] = {}

    def noting(name: str, answer: Any = None) -> Any:
        def call(*arguments: Any, **named: Any) -> Any:
            told.setdefault(name, []).append((arguments, named))
            return answer

        return call

    monkeypatch.setattr(perceive, "kitti_folder", lambda path: path or Path("usual"))
    monkeypatch.setattr(perceive, "perceive", noting("perceive", Trace()))
    monkeypatch.setattr(intake, "write_trace", noting("write"))
    return told


def test_a_drive_with_what_holds_unless_it_is_said(asked, capsys):
    assert main([*DRIVE, "--out", "t.parquet"]) == 0
    (((root, selection, settings), _),) = asked["perceive"]
    assert root == Path("usual")
    assert (selection.drive, selection.cameras) == ("2011_09_26/0005", ["02", "03"])
    assert selection.origin is None and not selection.allow_missing_scans
    assert (settings.name, settings.weights, settings.size) == ("yolox_nano", None, None)
    assert (settings.min_score, settings.threads) == (0.3, 1)
    assert settings.providers == ("CPUExecutionProvider",) and settings.encoding == "raw"
    (((path, _), _),) = asked["write"]
    assert path == Path("t.parquet")
    assert capsys.readouterr().out == "t.parquet: 3 frames, 3 detections, content 0123456789ab\n"
    assert {*asked} == {"perceive", "write"}


def test_every_option_of_a_drive_is_heard(asked):
    line = (
        "--out t.parquet --kitti /k --cameras 02 --detector nanodet_m_416 --weights /w --size 8x4"
    )
    line += " --providers CUDAExecutionProvider,CPUExecutionProvider --threads 4"
    line += " --min-score 0.2 --origin 49,8,112 --allow-missing-scans --encoding jpeg-q75"
    encodings = cli_perceive.get_args(cli_perceive.Encoding)
    line = line.replace("jpeg-q75", encodings[-1])
    assert main([*DRIVE, *line.split()]) == 0
    (((root, selection, settings), _),) = asked["perceive"]
    assert root == Path("/k") and selection.cameras == ["02"]
    assert selection.origin == (49.0, 8.0, 112.0) and selection.allow_missing_scans
    assert (settings.name, settings.weights) == ("nanodet_m_416", Path("/w"))
    assert (settings.size, settings.threads) == ((8, 4), 4)
    assert settings.providers == ("CUDAExecutionProvider", "CPUExecutionProvider")
    assert (settings.min_score, settings.encoding) == (0.2, encodings[-1])


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ([], "give either --drive or --check"),
        (["--drive", "a"], "say with --out which file to write"),
        (["--check", "a", "--drive", "b"], "give either --drive or --check"),
        (["--check", "a", "--out", "b"], "--out: has no effect with --check"),
    ],
)
def test_what_does_not_go_together_is_one_line(asked, capsys, options, message):
    assert main(["perceive", *options]) == 1
    line = capsys.readouterr().err
    assert line.startswith("genie-sim: perceive: ") and message in line
    assert len(line.splitlines()) == 1 and not asked


def test_what_is_there_on_a_drive_is_counted(monkeypatch, capsys):
    rows = [
        SimpleNamespace(object=1, moving=True, visible=True),
        SimpleNamespace(object=1, moving=True, visible=True),
        SimpleNamespace(object=2, moving=False, visible=False),
    ]
    table = SimpleNamespace(rows=rows, digest="abcdef0123456789")
    asked: list[Any] = []
    written: list[Path] = []
    monkeypatch.setattr(files, "find", lambda kind, name: Path(f"/traces/{name}.parquet"))
    monkeypatch.setattr(trace, "read_trace", lambda path: path)
    monkeypatch.setattr(perceive, "kitti_folder", lambda path: path)

    def make_truth(*given: Any) -> SimpleNamespace:
        given[3].leave_out("labels of nothing")
        asked.append(given)
        return table

    monkeypatch.setattr(drive_truth, "make_truth", make_truth)
    monkeypatch.setattr(truth, "write_truth", lambda path, _: written.append(path))
    line = ["import", "truth", "--drive", "tracking/0005", "--trace", "mine", "--kitti", "/k"]
    assert main(line) == 0 and main([*line, "--out", "o.parquet"]) == 0
    assert asked[0][:3] == (Path("/k"), "tracking/0005", Path("/traces/mine.parquet"))
    assert written == [Path("/traces/mine.truth.parquet"), Path("o.parquet")]
    told = "2 objects, 1 of them moving, visible 2 times, content abcdef012345\n"
    said = capsys.readouterr().out
    assert f"o.parquet: {told}" in said and said.count("labels of nothing") == 2
