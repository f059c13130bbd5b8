"""The methods of one run side by side, each in a process of its own.

Methods share nothing but the scenario and its random streams, so the tables are those of the
methods one after the other, to the byte.
"""

import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from genie_sim.base.parallel import in_processes
from genie_sim.base.progress import Progress
from genie_sim.record.records import SCHEMAS, Tables, new_tables
from genie_sim.record.tables import read

# Adds the rows of the method with a number to empty tables.
Simulate = Callable[[int, Tables, Progress], None]


@dataclass(frozen=True)
class MethodJob:
    """The ``number``-th method of a scenario, the folder that gets its tables, and how long it has
    simulated.
    """

    number: int
    folder: Path
    simulated_s: float = 0.0


def side_by_side(
    simulate: Simulate,
    methods: int,
    workers: int,
    progress: Progress | None = None,
    spill: Path | None = None,
) -> Tables:
    """The tables of so many methods, in their order, simulated in so many processes.

    ``simulate`` is pickled. ``progress`` is called after each method. With ``spill``, a folder, the
    rows of long tables wait there. Raises what ``simulate`` raises, and ``UserError`` where a
    process was killed.
    """
    tables = new_tables(spill)
    with tempfile.TemporaryDirectory(dir=spill) as scratch:
        jobs = [MethodJob(number, Path(scratch) / str(number)) for number in range(methods)]
        for job in jobs:
            job.folder.mkdir()
        done_s = 0.0
        for job in in_processes(partial(_write_tables, simulate), jobs, workers):
            for name, table in tables.items():
                path = job.folder / f"{name}.parquet"
                table.extend_columns(read(path, SCHEMAS[name], trusted=True))
                path.unlink()
            done_s += job.simulated_s
            if progress is not None:
                progress(done_s, done_s / (job.number + 1) * methods, "")
    return tables


def _write_tables(simulate: Simulate, job: MethodJob) -> MethodJob:
    """Simulates one method and writes its tables."""
    tables = new_tables(job.folder)
    ends_s = [0.0]
    simulate(job.number, tables, lambda now_s, end_s, text: ends_s.append(end_s))
    for name, table in tables.items():
        table.write(job.folder / f"{name}.parquet")
    return replace(job, simulated_s=ends_s[-1])
