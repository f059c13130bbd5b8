"""From the points of a design to runs with ids."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from genie_sim.base.errors import UserError
from genie_sim.base.progress import Progress
from genie_sim.base.settings import plain_data
from genie_sim.record import provenance
from genie_sim.report.output import Output
from genie_sim.runs.own_classes import origin_of, own_code_named
from genie_sim.runs.prepare import SharedFrames, facts
from genie_sim.scenario.reading import load_scenario, read_scenario
from genie_sim.scenario.scenario import FRAME_SOURCE, Scenario
from genie_sim.study.design import Design, Level, SweepPoint
from genie_sim.study.work import PointRun


@dataclass(frozen=True, slots=True)
class Entry:
    """One run's place in the sweep. Two points may share a run, where they say the same in two
    ways.
    """

    point: int
    seed: int
    run_id: str
    levels: tuple[Level, ...]


@dataclass
class Plan:
    """Every place of the sweep, and every run by its id."""

    entries: list[Entry] = field(default_factory=list)
    runs: dict[str, PointRun] = field(default_factory=dict)


def plan(
    design: Design,
    where: str,
    progress: Progress | None = None,
    *,
    base: Scenario | None = None,
    methods: Sequence[str] = (),
    reports: bool = True,
) -> Plan:
    """Checks every point and gives every run its id.

    Parameters
    ----------
    design : Design
        The sweep.
    where : str
        Where it comes from, to begin errors with.
    progress : callable, optional
        Told how many points are checked, of how many.
    base : Scenario, optional
        The scenario that the design names, where that is no file.
    methods : sequence of str
        Only these, at every point; none: those of the scenario.
    reports : bool
        Whether runs whose results are kept have a page.

    Raises
    ------
    UserError
        Naming the setting that is wrong.
    """
    planned = Plan()
    frames = SharedFrames()
    total = design.runs // len(design.seeds)
    for number, point in enumerate(design.points()):
        levels = ", ".join(
            f"{name} = {level}" for name, level in zip(design.axes, point.levels, strict=True)
        )
        try:
            point_base = base if point.scenario == design.scenario else None
            scenario = _scenario(point, point_base, methods)
            name = f"point {number} ({levels})" if levels else ""
            for run in runs_of(scenario, frames, design.seeds, name):
                run = replace(run, keep=not design.axes, output=Output(page=reports))
                planned.entries.append(Entry(number, run.scenario.seed, run.run_id, point.levels))
                planned.runs.setdefault(run.run_id, run)
        except UserError as error:
            which = f"{point.scenario}: " if point.scenario != design.scenario else ""
            raise UserError(f"{where}: {which}{error}") from error
        if progress is not None:
            progress(number + 1, total, "checking points")
    return planned


def _scenario(point: SweepPoint, base: Scenario | None, methods: Sequence[str]) -> Scenario:
    """The scenario at a point. Raises ``UserError``."""
    more: Any = {"methods": methods, "settings_from": ""}
    more["methods_from"] = f"--methods {','.join(methods)}"
    if base is None:
        return load_scenario(point.scenario, point.overrides, **more)
    if not point.overrides and not methods:
        return base
    return read_scenario(plain_data(base), point.overrides, profiles=base.profiles, **more)


def runs_of(
    scenario: Scenario, frames: SharedFrames, seeds: Sequence[int], point: str
) -> Iterator[PointRun]:
    """A point's run with each seed; ``point`` names it where a run fails. Raises ``UserError``."""
    prepared = frames.prepare(scenario)
    for seed in seeds:
        seeded = replace(scenario, seed=seed)
        if prepared.frames.seeded:
            with own_code_named(seeded):
                source = FRAME_SOURCE.make(seeded.perception).open(seed, seeded.origin)
                seed_facts = facts(
                    seeded,
                    seeded.new_methods(),
                    devices=prepared.devices,
                    frames=source,
                    encoded=prepared.encoded,
                    origin=origin_of(source, seeded.perception.name),
                )
        else:  # nothing else differs
            seed_scenario = {**prepared.facts["scenario"], "seed": seed}
            seed_facts = {**prepared.facts, "scenario": seed_scenario}
        place = ", ".join(filter(None, [point, f"seed {seed}"]))
        yield PointRun(provenance.run_id(seed_facts), seeded, place)
