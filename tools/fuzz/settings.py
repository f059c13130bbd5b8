"""What users write, or pass on: scenarios, sweeps, options, result folders."""

from __future__ import annotations

import contextlib
import io
import json
import os
import random
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any
from unittest import mock

import yaml

from genie_sim.analysis import compare_tables
from genie_sim.analysis.compare import compare
from genie_sim.analysis.seed_runs import load_run
from genie_sim.base import plugins
from genie_sim.base.errors import UserError
from genie_sim.cli.main import main
from genie_sim.kinds import Run
from genie_sim.record.provenance import digests
from genie_sim.record.records import SCHEMAS
from genie_sim.record.tables import Schema, read
from genie_sim.runs.folder import rerun, run_to_folder
from genie_sim.runs.prepare import prepare
from genie_sim.runs.simulate import simulate
from genie_sim.scenario.reading import load_scenario
from genie_sim.study.design import load_design
from genie_sim.study.plan import plan
from genie_sim.study.study import Study
from genie_sim.study.sweep import Sweep
from tests.checkout import REPOSITORY
from tools.fuzz.files import one_file
from tools.fuzz.harness import Case, Target
from tools.fuzz.mutation import broken, changed

TINY = """
description: One car and one edge, for a moment.
edges: [{name: edge1, device: agx_xavier}]
cars: [{name: car1, device: jetson_tx2, edge: edge1, link: wifi, route: {window: [0 s, 300 ms]}}]
methods: [local, {name: tiny, method: genie, genie: {eviction: lru, capacity: 3 entries}}]
faults: [{fault: outage, target: car1, begin: 100 ms, end: 200 ms}]
genie: {similarity: {name: pose_grid, cell: 2 m}, object_map: {forget_after: 1 s}}
"""
LONG_NS = 10**9  # what is simulated is shorter
MAX_RUNS = 20  # of a sweep whose points are all checked


def settings_case(folder: Path, files: list[Path], read: Callable[[Path], object]) -> Case:
    """One of the files, its text broken or its values changed."""
    texts = [path.read_bytes() for path in files]
    trees = [yaml.safe_load(text) for text in texts]
    path = folder / "broken.yaml"

    def case(rng: random.Random) -> None:
        at = rng.randrange(len(files))
        if rng.random() < 0.4:
            path.write_bytes(broken(texts[at], rng))
        else:
            path.write_text(yaml.safe_dump(changed(trees[at], rng), allow_unicode=True))
        read(path)

    return case


def scenarios(folder: Path) -> Case:
    """Read, prepared, and simulated where that takes no time."""
    (folder / "tiny.yaml").write_text(TINY)
    shipped = [
        path
        for path in sorted((REPOSITORY / "scenarios").glob("*.yaml"))
        if not path.stem.startswith("fleet_")
    ]

    def use(path: Path) -> None:
        scenario = load_scenario(path)
        if scenario.fleet is not None or hasattr(scenario.source, "town"):
            return  # it takes seconds to make
        prepared = prepare(scenario)
        windows_ns = [car.route.window_ns or (0, LONG_NS) for car in scenario.cars]
        if all(end - begin < LONG_NS for begin, end in windows_ns) and all(
            car.route.laps < 5 for car in scenario.cars
        ):
            simulate(prepared)

    return settings_case(folder, [*shipped, *[folder / "tiny.yaml"] * 6], use)


def sweeps(folder: Path) -> Case:
    """Read, and every point of it checked where there are few."""

    def use(path: Path) -> None:
        design = load_design(path)
        if design.runs <= MAX_RUNS and "fleet" not in design.scenario:
            plan(design, str(path))

    return settings_case(folder, sorted((REPOSITORY / "scenarios" / "sweeps").glob("*.yaml")), use)


WORDS = (
    "",
    "x",
    "-1",
    "0",
    "1",
    "9" * 5000,
    "1e400",
    "nan",
    "inf",
    "\u0663",
    "1_0",
    "\u0663x\u0663",
    "832x256",
    "999999999x1",
    "1/2",
    "2/1",
    "49.0,8.4,112",
    "91,0,0",
    "nan,nan,nan",
    "49,8",
    "a,b,c",
    "cars[0].device=orin_nano",
    "cars[9].device=x",
    "=",
    "a=b",
    "genie.eviction=lru",
    "genie.eviction=nowhere:X",
    "cars=",
    "cars[0]",
    "cars[-1].name=x",
    "[[]]=1",
    "cars[\u0663].name=x",
    "genie.capacity=9e99 MB",
    "methods=[local]",
    "local",
    "local,local",
    "genie,",
    "tiny",
    "a\0b",
    "a\nb",
    "\udcff",
    "/dev/null",
    "/dev/zero",
    "/",
    "~",
    "~nobody",
    ".",
    "..",
    "x" * 5000,
    "nowhere",
    "edge1@h:1",
    "h:99999",
    "h:\u0663",
    "--help",
)
COMMANDS: dict[str, tuple[str, ...]] = {
    "run tiny.yaml": ("--set", "--seed", "--seeds", "--label", "--methods", "--out"),
    "report": ("--start", "--out"),
    "export": ("--format", "--methods", "--out"),
    "rerun": (),
    "compare": ("--methods", "--metrics", "--label", "--format"),
    "reproduce": ("--seeds", "--jobs", "--out"),
    "perceive": (
        "--drive",
        "--size",
        "--origin",
        "--threads",
        "--batch",
        "--min-score",
        "--cameras",
        "--detector",
        "--weights",
        "--out",
        "--providers",
    ),
    "import truth": (),
    "import tables": ("--fov", "--frame-size", "--range", "--origin", "--out"),
    "profile": ("--csv", "--model", "--runs", "--out", "--detector"),
    "import fetch model": ("--out",),
    "import fetch drive": ("--out",),
    "sweep": (
        "--axis",
        "--set",
        "--seeds",
        "--jobs",
        "--shard",
        "--out",
    ),
    "list": (),
    "show": ("--kind", "--schema"),
    "": ("--version",),
}


def options(folder: Path) -> Case:
    """Whole command lines. What would simulate, download or listen stops before it begins."""
    (folder / "tiny.yaml").write_text(TINY)

    def stop(*_: object, **__: object) -> Any:
        raise UserError("stopped before it begins")

    def case(rng: random.Random) -> None:
        command, known = rng.choice(list(COMMANDS.items()))
        line = command.split() + [rng.choice(WORDS) for _ in range(rng.randint(0, 2))]
        for option in rng.sample(known, min(len(known), rng.randint(0, 3))):
            line += [option, rng.choice(WORDS)]
        if rng.random() < 0.2:
            line[rng.randrange(len(line)) if line else 0 :] = [rng.choice(WORDS)]
        run_command(line)

    def guarded(rng: random.Random) -> None:
        stopped = (
            "runs.folder.run_to_folder",
            "paper.reproduce.reproduce",
            "data.fetch.receive",
            "scenario.device_fit.measure",
            "study.study.Study.run",
        )
        with contextlib.ExitStack() as stack:
            for name in stopped:
                stack.enter_context(mock.patch(f"genie_sim.{name}", stop))
            stack.enter_context(contextlib.chdir(folder))
            stack.enter_context(mock.patch.dict(os.environ, ROS_HOME=str(folder), HOME=str(folder)))
            case(rng)

    return guarded


def run_command(line: list[str]) -> None:
    """Runs a command line: it works, or raises the one line that it says."""
    said, wrong = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(wrong):
        status = main(line)
    assert "Traceback" not in said.getvalue() + wrong.getvalue(), wrong.getvalue()
    if status == 1:
        raise UserError(wrong.getvalue().removesuffix("\n"))
    if status == 2:  # a usage error has its usage before it
        raise UserError(wrong.getvalue().rstrip("\n").rpartition("\n")[2])
    assert status == 0, status


def result_folders(folder: Path) -> Case:
    """A file of a run's or a sweep's folder broken, or ``run.json`` with other values; then every
    command on it.
    """
    (folder / "tiny.yaml").write_text(TINY)
    made = folder / "made"
    with mock.patch("genie_sim.analysis.figures.save"):
        run = run_to_folder(load_scenario(folder / "tiny.yaml"), folder / "runs").folder.rename(
            made
        )
        axes = {"range": {"set": "genie.view_range", "list": ["20 m", "30 m"]}}
        sweep = {
            "scenario": str(folder / "tiny.yaml"),
            "set": {"methods": ["local"]},
            "axes": axes,
            "seeds": 1,
        }
        (folder / "s.yaml").write_text(yaml.safe_dump(sweep))
        work = Study.of(load_design(folder / "s.yaml"), "s.yaml", folder)
        work.run(1)
        work.finish()
        swept = work.folder
    whole = {
        path: path.read_bytes() for path in [*run.iterdir(), *swept.iterdir()] if path.is_file()
    }

    def use(rng: random.Random, path: Path) -> None:
        if path.is_relative_to(swept):
            if rng.random() < 0.5:
                Sweep.read(swept).text()
            else:
                Study.of(load_design(folder / "s.yaml"), "s.yaml", folder).finish()
            return
        what = rng.randrange(4)
        if what == 0:
            with (
                plugins.own_code_allowed(False),
                mock.patch("genie_sim.runs.folder.simulate_into", side_effect=UserError("stopped")),
            ):
                rerun(run)
        elif what == 1:
            Run.read(run).report()
        elif what == 2:
            compare_tables.text(compare([load_run(run)], ()), "csv")
        else:
            run_command(["export", str(run), "--out", str(folder / "run.mcap")])

    def case(rng: random.Random) -> None:
        path = rng.choice(list(whole))
        if path.suffix == ".json" and rng.random() < 0.7:
            path.write_text(json.dumps(changed(json.loads(whole[path]), rng)))
        else:
            path.write_bytes(broken(whole[path], rng))
        about = path.with_name("sweep.json" if path.is_relative_to(swept) else "run.json")
        if path != about and path.name in json.loads(whole[about])["digests"]:  # a hidden change
            said = json.loads(whole[about])
            said["digests"] |= digests(path.parent, [path.name])
            about.write_text(json.dumps(said))
        try:
            with mock.patch("genie_sim.analysis.figures.save"):
                use(rng, path)
        finally:
            path.write_bytes(whole[path])
            about.write_bytes(whole[about])

    return case


def result_tables(folder: Path) -> Case:
    (folder / "tiny.yaml").write_text(TINY)
    with mock.patch("genie_sim.analysis.figures.save"):
        run = run_to_folder(load_scenario(folder / "tiny.yaml"), folder).folder
    cases = [
        one_file(
            run / f"{schema.name}.parquet",
            (run / f"{schema.name}.parquet").read_bytes(),
            partial(_read, schema),
        )
        for schema in SCHEMAS.values()
    ]
    return lambda rng: rng.choice(cases)(rng)


def _read(schema: Schema, path: Path) -> None:
    read(path, schema)


TARGETS = (
    Target("result tables", 100, result_tables),
    Target("scenarios", 200, scenarios),
    Target("sweeps", 60, sweeps),
    Target("options", 120, options),
    Target("result folders", 40, result_folders),
)
