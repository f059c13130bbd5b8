"""A study that a program declares: a table of set-ups, each with a run that measures itself."""

import hashlib
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from genie_sim.study.design import Level
from genie_sim.study.parts import Parts, Progress
from genie_sim.study.tasks import LocalWorkers, StudyRun
from genie_sim.version import PACKAGE_FOLDER

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, slots=True)
class StudySetup:
    """One line of a study's table: the value of each axis, and the run that follows."""

    levels: Mapping[str, Level]
    run: StudyRun


def measured(
    setups: Sequence[StudySetup],
    workers: int,
    folder: Path | None = None,
    progress: Progress | None = None,
) -> "pd.DataFrame":
    """Runs a study in processes on this machine.

    Parameters
    ----------
    setups : sequence of StudySetup
        All with the same axes.
    workers : int
        How many processes.
    folder : Path, optional
        Keeps the finished runs, so that they are not run again.
    progress : callable, optional
        Told how many runs are done, of how many.

    Returns
    -------
    DataFrame
        One row per set-up and metric: the axes' values, then the columns of a part.
    """
    import pandas as pd

    with tempfile.TemporaryDirectory() as scratch:
        parts = Parts(folder or Path(scratch))
        parts.parts.mkdir(parents=True, exist_ok=True)
        parts.run([setup.run for setup in setups], LocalWorkers(workers), progress=progress)
        run_ids = [setup.run.run_id for setup in setups]
        table = pd.DataFrame([setup.levels for setup in setups]).assign(run_id=run_ids)
        return table.merge(parts.read(run_ids), on="run_id")


def run_id_of(*decides: object) -> str:
    """A run's id from all that decides its outcome, to which the package's code is added."""
    return hashlib.sha256(repr((_code_digest(), decides)).encode()).hexdigest()[:16]


@cache
def _code_digest() -> str:
    """Of the whole package: a run of other code is another run."""
    digest = hashlib.sha256()
    for path in sorted(PACKAGE_FOLDER.rglob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()
