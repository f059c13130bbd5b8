"""Runs a scenario, in memory or into a result folder, and makes a result folder anew."""

import logging
import tempfile
import time
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from genie_sim.base.errors import UserError, short_repr
from genie_sim.base.paths import read_text, sha256_of
from genie_sim.base.progress import Progress
from genie_sim.base.settings import read
from genie_sim.record import folders, provenance
from genie_sim.record.columns import Text
from genie_sim.record.records import SCHEMAS, Tables
from genie_sim.record.results import (
    FILES,
    MethodInfo,
    Run,
    checked_label,
)
from genie_sim.record.tables import read as read_columns
from genie_sim.report.output import DEFAULT_OUTPUT, SHOWN, Output
from genie_sim.runs.prepare import Prepared, prepare
from genie_sim.runs.simulate import Observer, simulate
from genie_sim.scenario.profiles import DeviceProfile
from genie_sim.scenario.reading import read_scenario
from genie_sim.scenario.scenario import Scenario, as_yaml
from genie_sim.scenario.yaml_input import parse

log = logging.getLogger(__name__)
IDENTICAL, EQUAL, DIFFERENT = "identical", "equal", "DIFFERENT"  # bytes, contents, neither


def run_to_folder(
    scenario: Scenario,
    out: Path,
    progress: Progress | None = None,
    output: Output = DEFAULT_OUTPUT,
    *,
    label: str = "",
) -> Run:
    """Simulates a scenario and writes ``out/<scenario>-<run id>``, with what ``output`` says;
    ``label`` is what the user calls the run.

    Raises ``UserError`` before it simulates.
    """
    label = checked_label(label)
    folders.check_writable(out)
    prepared = prepare(scenario, progress)
    run_id = provenance.run_id(prepared.facts)
    folder = out / f"{scenario.name}-{run_id}"
    with folders.result_folder(folder, SHOWN) as unfinished:
        run = simulate_into(unfinished, prepared, run_id, progress=progress, label=label)
    output.write(run, folder)
    return replace(run, folder=folder)


def run_in_memory(
    scenario: Scenario,
    progress: Progress | None = None,
    *,
    label: str = "",
    observer: Observer | None = None,
) -> Run:
    """Simulates a scenario and writes nothing. An ``observer`` sees what is simulated.
    Raises ``UserError`` before it simulates.
    """
    label = checked_label(label)
    prepared = prepare(scenario, progress)
    run_id = provenance.run_id(prepared.facts)
    tables = simulate(prepared, progress, observer=observer)
    return finished(prepared, run_id, tables, label)


def simulate_into(
    folder: Path,
    prepared: Prepared,
    run_id: str,
    *,
    progress: Progress | None = None,
    label: str = "",
) -> Run:
    """Simulates a run and writes the files of its result folder. Raises ``UserError``.

    Parameters
    ----------
    folder : Path
        An empty folder.
    prepared : Prepared
        The scenario with everything it names.
    run_id : str
        The run's id.
    progress : callable, optional
        Called with the time now and at the end [s], and what is done.
    label : str
        What the user calls the run; may be empty.
    """
    from genie_sim.analysis import registry

    began_s = time.perf_counter()
    tables = simulate(prepared, progress, spill=folder)
    for name, table in tables.items():
        table.write(folder / f"{name}.parquet")
    run = finished(prepared, run_id, tables, label)
    wall_time_s = round(time.perf_counter() - began_s, 3)
    metrics = [metric._asdict() for metric in run.measured]
    provenance.write_json(folder / "metrics.json", metrics)
    provenance.write_text(folder / "scenario.resolved.yaml", run.yaml)
    about = {
        "format": provenance.RESULT_FORMAT,
        "run_id": run.run_id,
        **({"label": run.label} if run.label else {}),
        "facts": run.facts,
        "metrics": registry.words((metric.metric for metric in run.measured), run.words),
        "digests": provenance.digests(folder, FILES),
        "rows": {name: len(table) for name, table in tables.items()},
        "traces": {name: dict(known) for name, known in prepared.origin.provenance.items()},
        "wall_time_s": wall_time_s,
        **provenance.environment(),
    }
    # own settings keep the order in which they were written
    provenance.write_json(folder / "run.json", about, sort_keys=False)
    return run


def finished(prepared: Prepared, run_id: str, tables: Tables, label: str = "") -> Run:
    """The run that wrote these tables."""
    from genie_sim.analysis import metrics

    columns = {name: table.columns() for name, table in tables.items()}
    methods, own = methods_of(prepared), prepared.scenario.metrics
    return Run(
        run_id=run_id,
        facts=prepared.facts,
        yaml=as_yaml(prepared.facts["scenario"]),
        tables=columns,
        measured=metrics.compute(methods, columns, own=own),
        label=label,
        words=metrics.words_of_code(own),
    )


def methods_of(prepared: Prepared) -> list[MethodInfo]:
    """The methods that a scenario runs, in its order."""
    return [MethodInfo(**method) for method in prepared.facts["methods"]]


def scenario_of(facts: Mapping[str, Any], where: str) -> Scenario:
    """The scenario of a run, with the device profiles it was made with; errors begin with
    ``where``. Raises ``UserError``.
    """
    profiles = {
        name: read(DeviceProfile, device, lambda _: where)
        for name, device in facts["devices"].items()
    }
    return read_scenario(facts["scenario"], where=where, profiles=profiles)


def rerun(folder: Path, progress: Progress | None = None) -> dict[str, str]:
    """Runs a result folder's scenario again, with the device profiles it was made with: how each of
    its tables, its metrics and its scenario compare. ``run.json`` holds the wall time, and what
    people look at shows the versions: neither is compared.

    Raises ``UserError``, also for files that were changed since.
    """
    made = provenance.read_run_json(folder)
    for line in provenance.other_versions(made):
        log.warning("%s: %s", folder, line)
    prepared = prepare(scenario_of(made["facts"], str(folder / "run.json")), progress)
    for key in {**made["facts"], **prepared.facts}:
        before, now = made["facts"].get(key), prepared.facts.get(key)
        if now != before:
            raise UserError(f"{folder}: {_difference(key, before, now)}")
    provenance.check_unchanged(folder, made, FILES)
    with tempfile.TemporaryDirectory() as temporary:
        simulate_into(Path(temporary), prepared, made["run_id"], progress=progress)
        return {name: _compared(folder / name, Path(temporary, name)) for name in FILES}


def _compared(before: Path, path: Path) -> str:
    """How a file at ``path`` compares with the one ``before``."""
    if sha256_of(before) == sha256_of(path):
        return IDENTICAL
    if path.suffix == ".parquet":
        schema = SCHEMAS[path.stem]
        rows, again_rows = read_columns(before, schema), read_columns(path, schema, trusted=True)
        is_equal = len(rows) == len(again_rows) and all(
            _equal(rows[column.name], again_rows[column.name]) for column in schema.columns
        )
    elif path.suffix == ".json":
        is_equal = provenance.read_json(before) == provenance.read_json(path)
    else:
        first, second = (parse(read_text(file), str(file)) for file in (before, path))
        is_equal = first == second
    return EQUAL if is_equal else DIFFERENT


def _equal(first: Any, second: Any) -> bool:
    """Whether two columns hold the same values, unknown ones in the same rows."""
    if isinstance(first, Text) or isinstance(second, Text):
        return bool(first.tolist() == second.tolist())
    return bool(np.array_equal(first, second, equal_nan=first.dtype.kind == "f"))


def _difference(name: str, before: object, now: object) -> str:
    """Where two facts differ, as short as can be: ``devices.jetson_tx2.cores.value: 6 when it was
    made, 8 now``.
    """
    if isinstance(before, Mapping) and isinstance(now, Mapping):
        for key in (*now, *before):
            if before.get(key) != now.get(key):
                return _difference(f"{name}.{key}", before.get(key), now.get(key))
    return f"{name}: {short_repr(before)} when it was made, {short_repr(now)} now"
