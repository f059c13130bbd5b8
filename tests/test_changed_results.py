"""Results that somebody changed: refused in one line, or read for what they are."""

from __future__ import annotations

import json
import shutil
from itertools import cycle
from pathlib import Path

import pytest

import genie_sim as gs
from genie_sim.analysis.seed_runs import read_about
from genie_sim.base.errors import UserError
from genie_sim.cli.main import main
from genie_sim.record import provenance, results
from genie_sim.report.output import Output
from genie_sim.runs.folder import run_to_folder
from genie_sim.scenario.reading import load_scenario
from tests.checkout import REPOSITORY, copied, sign

SHORT = ["cars[0].route.window=[0 s, 1 s]", "methods=[local, genie]"]
READERS = (
    ("report",),
    ("rerun",),
    ("compare",),
    ("figures", "--format", "svg"),
    ("table",),
    ("table", "--format", "csv"),
)


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("results")
    scenario = load_scenario("street_1car_homo", SHORT)
    folder = run_to_folder(scenario, out, output=Output(page=False)).folder
    assert folder is not None
    return folder


@pytest.fixture
def folder(finished: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of a result folder, ``result`` in the current folder."""
    monkeypatch.chdir(tmp_path)
    return Path(shutil.copytree(finished, "result"))


def change_a_metric(folder: Path) -> None:
    path = folder / "metrics.json"
    metrics = json.loads(path.read_text())
    metrics[0]["value"] = 1.0
    provenance.write_json(path, metrics)


def change_a_table(folder: Path) -> None:
    import pyarrow as pa
    import pyarrow.compute as pc
    import pyarrow.parquet as pq

    path = folder / "frames.parquet"
    table = pq.ParquetFile(path).read()
    place = table.schema.get_field_index("first_answer_ns")
    early = pc.if_else(pc.is_null(table.column(place)), None, pa.scalar(1, pa.int64()))
    pq.write_table(table.set_column(place, table.schema.field(place), early), path)


def change_the_scenario(folder: Path) -> None:
    path = folder / "scenario.resolved.yaml"
    path.write_text(path.read_text() + "# faster\n")


def change_a_fact(folder: Path) -> None:
    path = folder / "run.json"
    about = json.loads(path.read_text())
    about["facts"]["scenario"]["description"] = "better"
    provenance.write_json(path, about)


def drop_a_digest(folder: Path) -> None:
    path = folder / "run.json"
    about = json.loads(path.read_text())
    del about["digests"]["poses.parquet"]
    provenance.write_json(path, about)


CHANGES = {
    "metrics.json": change_a_metric,
    "frames.parquet": change_a_table,
    "scenario.resolved.yaml": change_the_scenario,
    "run.json": change_a_fact,
    "poses.parquet": drop_a_digest,
}


@pytest.mark.parametrize(("command", "name"), [*zip(READERS, cycle(CHANGES))])
def test_every_command_that_reads_results_names_the_file_that_was_changed(
    command, name, folder, capsys
):
    CHANGES[name](folder)
    before = sorted(path.name for path in folder.iterdir())
    assert main([command[0], str(folder), *command[1:]]) == 1
    printed = capsys.readouterr()
    assert printed.err == (
        f"genie-sim: result: changed since the results were written: {name}; make them again\n"
    )
    assert not printed.out and sorted(path.name for path in folder.iterdir()) == before
    with pytest.raises(UserError, match=f"written: {name};"):
        gs.load(folder)


@pytest.mark.parametrize("kept", ["all twice", "none", "one twice, one not"])
def test_rows_that_are_not_those_of_the_run_are_refused(kept, folder):
    import pyarrow as pa
    import pyarrow.parquet as pq

    path = folder / "frames.parquet"
    table = pq.ParquetFile(path).read()
    rows = {
        "all twice": [table, table],
        "none": [table.slice(0, 0)],
        "one twice, one not": [table.slice(0, 1), table.slice(0, len(table) - 1)],
    }[kept]
    pq.write_table(pa.concat_tables(rows), path)
    sign(folder)
    with pytest.raises(UserError, match=r"frames\.parquet: (holds|row 1: method, car)"):
        gs.load(folder)


WRONG_METRICS = {
    "value": ["fast", True, float("inf"), float("nan"), 10**400, [], 1e300],
    "low": ["x", 1e300],
    "range_low": [float("-inf")],
    "n": [-3, 1.5, True],
    "unit": [["ms"], None],
    "metric": ["zzz", 5, {}],
    "method": ["nobody", None],
    "component": [None],
}


@pytest.mark.parametrize(
    ("field", "value"),
    [(field, value) for field, values in WRONG_METRICS.items() for value in values],
    ids=lambda value: str(value)[:20],
)
def test_a_number_that_no_run_has_is_named_with_its_row_and_field(field, value, folder):
    path = folder / "metrics.json"
    metrics = json.loads(path.read_text())
    place = next(place for place, row in enumerate(metrics) if row["low"] is not None)
    metrics[place][field] = value
    path.write_text(json.dumps(metrics))
    sign(folder)
    with pytest.raises(UserError, match=rf"metrics\.json: row {place}: {field}: "):
        gs.load(folder)


@pytest.mark.parametrize("change", ["twice", "no mapping", "a field more", "no list"])
def test_rows_of_metrics_that_no_run_writes_are_named(change, folder):
    path = folder / "metrics.json"
    metrics = json.loads(path.read_text())
    changed = {
        "twice": [*metrics, metrics[0]],
        "no mapping": [*metrics, 5],
        "a field more": [*metrics, metrics[0] | {"more": 1}],
        "no list": {},
    }[change]
    path.write_text(json.dumps(changed))
    sign(folder)
    where = "must be a list" if change == "no list" else f"row {len(metrics)}: "
    with pytest.raises(UserError, match=rf"metrics\.json: {where}"):
        gs.load(folder)


@pytest.mark.parametrize(
    "methods", [[], ["x"], [{"name": "a", "title": 5, "baseline": True}], "twice", "a field more"]
)
def test_methods_that_no_run_has_are_named_by_their_field(methods, folder):
    path = folder / "run.json"
    about = json.loads(path.read_text())
    first = about["facts"]["methods"][0]
    named = {"twice": [first, first], "a field more": [first | {"more": 1}]}
    about["facts"]["methods"] = named.get(str(methods), methods)
    about["run_id"] = provenance.run_id(about["facts"])
    path.write_text(json.dumps(about))
    with pytest.raises(UserError, match=r"run\.json: facts\.methods"):
        gs.load(folder)


@pytest.mark.parametrize(("command", "text"), [*zip(READERS, cycle(["[]", "null", '"x"', "{}"]))])
def test_what_is_no_mapping_is_one_line_with_the_file(text, command, tmp_path, capsys):
    (tmp_path / "run.json").write_text(text)
    assert main([command[0], str(tmp_path), *command[1:]]) == 1
    said = capsys.readouterr().err
    assert said.startswith("genie-sim: ") and "run.json" in said and said.count("\n") == 1


@pytest.mark.parametrize("wrong", [None, True, 5, "x", [], {}], ids=repr)
@pytest.mark.parametrize(
    ("name", "kind"), [("titles", dict), ("methods", list), ("run_ids", list), ("metrics", dict)]
)
def test_what_a_sweep_says_of_itself_is_of_its_kind(name, kind, wrong, tmp_path):
    (tmp_path / "sweep.json").write_text(
        json.dumps({"format": provenance.RESULT_FORMAT, "sweep": {}, name: wrong})
    )
    if isinstance(wrong, kind):
        assert read_about(tmp_path)[name] == wrong
    else:
        with pytest.raises(UserError, match=rf"sweep\.json: {name}: not a"):
            read_about(tmp_path)


@pytest.mark.parametrize("name", ["genie_sim", "plugins", "traces"])
def test_a_folder_that_lacks_a_fact_is_told_in_one_line(name, folder, capsys):
    path = folder / "run.json"
    about = json.loads(path.read_text())
    del about["facts"][name]
    about["run_id"] = provenance.run_id(about["facts"])
    provenance.write_json(path, about)
    assert main(["compare", str(folder)]) == 1
    printed = capsys.readouterr().err
    assert printed.startswith("genie-sim: result") and printed.count("\n") == 1


def test_a_table_with_a_number_that_no_run_writes_is_told_in_one_line(folder, capsys):
    import pyarrow as pa
    import pyarrow.parquet as pq

    path = folder / "frames.parquet"
    table = pq.ParquetFile(path).read()
    place = table.schema.get_field_index("stamp_ns")
    stamps = pa.array([None] * len(table), pa.int64())
    field = table.schema.field(place).with_nullable(True)
    pq.write_table(table.set_column(place, field, stamps), path)
    sign(folder)
    assert main(["compare", str(folder)]) == 1
    printed = capsys.readouterr().err
    assert printed.startswith("genie-sim: ") and printed.count("\n") == 1


@pytest.mark.parametrize("name", ["scenario.resolved.yaml", "metrics.json", "frames.parquet"])
def test_nothing_outside_the_folder_is_read_through_its_names(name, folder, capsys):
    Path(folder / name).rename("outside")
    (folder / name).symlink_to(Path("outside").resolve())
    for command in READERS[:3]:
        assert main([command[0], str(folder), *command[1:]]) == 1
        printed = capsys.readouterr().err
        assert f"result/{name}: a link out of the result folder" in printed
        assert printed.count("\n") == 1


@pytest.mark.slow
def test_nothing_is_written_through_a_link_out_of_the_folder(folder, capsys):
    victim = Path("victim.svg").resolve()
    victim.write_text("mine")
    (folder / "figures").mkdir()
    (folder / "figures" / "latency_cdf.svg").symlink_to(victim)
    (folder / "report.html").symlink_to(victim)
    assert main(["figures", str(folder)]) == 0 and main(["report", str(folder)]) == 0
    assert victim.read_text() == "mine"
    assert not (folder / "figures" / "latency_cdf.svg").is_symlink()
    shutil.rmtree(folder / "figures")
    elsewhere = Path("elsewhere").resolve()
    elsewhere.mkdir()
    (folder / "figures").symlink_to(elsewhere)
    capsys.readouterr()
    assert main(["figures", str(folder)]) == 1
    assert "result/figures: a link out of the result folder" in capsys.readouterr().err
    assert not list(elsewhere.iterdir())


def test_a_run_has_a_digest_of_each_of_its_files(finished):
    about = provenance.read_run_json(finished)
    assert set(results.FILES) == about["digests"].keys()
    provenance.check_unchanged(finished, about, results.FILES)


def test_the_committed_evaluation_is_what_was_written():
    folder = REPOSITORY / "results" / "paper"
    about = provenance.read_json(folder / "run.json")
    provenance.check_unchanged(folder, about, about["digests"])


@pytest.mark.slow
@pytest.mark.usefixtures("without_figures")
def test_a_changed_evaluation_and_a_changed_sweep_are_refused(tmp_path, capsys):
    folder = copied(REPOSITORY / "results" / "paper", tmp_path / "paper")
    page = tmp_path / "page.html"
    assert main(["report", str(folder), "--out", str(page)]) == 0
    (folder / "verdicts.json").write_text((folder / "verdicts.json").read_text() + "\n")
    assert main(["report", str(folder), "--out", str(page)]) == 1
    assert "changed since the results were written: verdicts.json" in capsys.readouterr().err

    gs.sweep(
        "street_1car_homo",
        {"seed_of_links": {"set": "cars[0].link", "list": ["wifi", "lte"]}},
        {"cars[0].route.window": ["0 s", "1 s"], "methods": ["local"]},
        seeds=[1],
        jobs=1,
        out=tmp_path,
    )
    (folder,) = tmp_path.glob("street_1car_homo-*")
    assert main(["table", str(folder)]) == 0
    (folder / "table.parquet").write_bytes((folder / "table.parquet").read_bytes() + b" ")
    assert main(["table", str(folder)]) == 1
    assert "table.parquet" in capsys.readouterr().err
