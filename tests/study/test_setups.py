"""A study that a program declares."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from genie_sim.recording.results import Metric
from genie_sim.study.setups import StudySetup, measured, run_id_of


@dataclass(frozen=True)
class Doubling:
    """What it measures is twice its number."""

    number: int
    frames = 1.0

    @property
    def run_id(self) -> str:
        return run_id_of("doubling", self.number)

    @property
    def place(self) -> str:
        return f"number {self.number}"

    def measure(self, shared: object, folder: Path) -> Mapping[str, Sequence[Metric]]:
        with (folder / "log.txt").open("a") as log:
            log.write(f"{self.number}\n")
        metric = Metric("first_answer_mean", "genie", "all", "", 2.0 * self.number, "ms", 1)
        return {self.run_id: [metric]}

    def is_kept(self, study_folder: Path) -> bool:
        return True


def setups(*numbers: int) -> list[StudySetup]:
    return [StudySetup({"number": float(number)}, Doubling(number)) for number in numbers]


def test_each_setup_is_a_row_with_its_levels_and_what_it_measured(tmp_path: Path):
    told: list[tuple[float, float]] = []
    table = measured(
        setups(3, 1), 1, tmp_path, progress=lambda done, of, _: told.append((done, of))
    )
    assert table[["number", "metric", "value"]].values.tolist() == [
        [3.0, "first_answer_mean", 6.0],
        [1.0, "first_answer_mean", 2.0],
    ]
    assert told[-1] == (2, 2)


def test_what_is_done_is_not_run_again(tmp_path: Path):
    measured(setups(3), 1, tmp_path)
    table = measured(setups(3, 4), 1, tmp_path)
    assert table["value"].tolist() == [6.0, 8.0]
    (log,) = tmp_path.rglob("log.txt")
    assert log.read_text().split() == ["3", "4"]
