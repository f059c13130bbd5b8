"""From the points of a sweep to runs with ids, and from runs to tasks."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from genie_sim import runner
from genie_sim.build import Prepared
from genie_sim.errors import UserError
from genie_sim.perception.sources import Frames, Progress
from genie_sim.recording import provenance
from genie_sim.scenario.scenario import Scenario, load_scenario
from genie_sim.sweeps.design import Design, Level
from genie_sim.sweeps.tasks import Run, Shared, Task

TASK_FRAMES = 30_000  # about ten seconds of work, which is what a kill may cost a worker
LEAST_TASKS_A_WORKER = 4  # so that no worker waits long for the last one

# Settings that say nothing about which profiles and traces are needed.
_SAME_FILES = {
    "name", "description", "seed", "methods", "model", "spread", "start_jitter_ns", "queue_length", "edge_network",
    "genie", "faults",
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Entry:
    """One run's place in the sweep. Two points may share a run, where they say the same in two ways."""

    point: int
    seed: int
    run_id: str
    levels: tuple[Level, ...]


@dataclass
class Plan:
    """Every place of the sweep, every run by its id, and what the runs need."""

    entries: list[Entry] = field(default_factory=list)
    runs: dict[str, Run] = field(default_factory=dict)
    shared: Shared = field(default_factory=dict)


def plan(design: Design, where: str, progress: Progress | None = None) -> Plan:
    """Checks every point and gives every run its id. Raises ``UserError`` naming the setting that is wrong."""
    made = Plan()
    world = _World()
    total = design.runs // len(design.seeds)
    for number, point in enumerate(design.points()):
        levels = ", ".join(
            f"{name} = {level}" for name, level in zip(design.axes, point.levels, strict=True)
        )
        try:
            scenario = load_scenario(point.scenario, point.overrides)
            for run in _runs_of(
                world.prepare(scenario), design.seeds, f"point {number} ({levels})"
            ):
                made.entries.append(Entry(number, run.scenario.seed, run.run_id, point.levels))
                made.runs.setdefault(run.run_id, run)
        except UserError as error:
            which = f"{point.scenario}: " if point.scenario != design.scenario else ""
            raise UserError(f"{where}: {which}{str(error).removeprefix('--set ')}") from error
        if progress is not None:
            progress(number + 1, total, "checking points")
    made.shared = world.frames
    return made


def _runs_of(prepared: Prepared, seeds: Sequence[int], point: str) -> Iterator[Run]:
    """A point's run with each seed."""
    key = None if prepared.frames.seeded else _key(prepared)
    frames = _frames(prepared)
    for seed in seeds:
        seeded = replace(prepared, scenario=prepared.scenario.model_copy(update={"seed": seed}))
        if prepared.frames.seeded:
            seeded = replace(
                seeded,
                frames=runner.frame_source(seeded.scenario).open(seed, seeded.scenario.origin),
            )
        run_id = provenance.run_id(runner.facts(seeded))
        yield Run(run_id, seeded.scenario, key, frames, f"{point}, seed {seed}")


def tasks(runs: Sequence[Run], workers: int, folder: Path) -> list[Task]:
    """Runs grouped into tasks of about equal length, the longest first."""
    most = min(TASK_FRAMES, sum(run.frames for run in runs) / (LEAST_TASKS_A_WORKER * workers))
    groups: list[list[Run]] = []
    room = 0.0
    for run in sorted(runs, key=lambda run: (-run.frames, run.run_id)):
        if run.frames > room:
            groups.append([])
            room = most
        groups[-1].append(run)
        room -= run.frames
    return [Task(tuple(group), str(folder.absolute())) for group in groups]


class _World:
    """Traces, read once for all points that need the same ones."""

    def __init__(self) -> None:
        self.frames: dict[str, Frames] = {}
        self._known: dict[str, Frames] = {}

    def prepare(self, scenario: Scenario) -> Prepared:
        """As ``runner.prepare``."""
        needs = scenario.model_dump_json(exclude=_SAME_FILES)
        known = self._known.get(needs)
        prepared = runner.prepare(scenario) if known is None else runner.on_frames(scenario, known)
        if not prepared.frames.seeded:
            self._known[needs] = self.frames.setdefault(_key(prepared), prepared.frames)
        return prepared


def _key(prepared: Prepared) -> str:
    """Names the frames that a scenario needs."""
    source = prepared.scenario.model_dump_json(include={"perception", "origin"})
    return f"{source} {sorted(prepared.frames.digests().items())}"


def _frames(prepared: Prepared) -> float:
    """About how many frames the cameras take, under all methods."""
    frames = 0.0
    for car in prepared.expanded.cars:
        for camera in prepared.expanded.cameras_of(car):
            recorded = prepared.drives[car.name].frames[camera.recording]
            length_ns = recorded[-1].stamp_ns - recorded[0].stamp_ns
            window_ns = car.route.window_ns
            driven = (
                1.0
                if window_ns is None or not length_ns
                else min((window_ns[1] - window_ns[0]) / length_ns, 1.0)
            )
            frames += driven * len(recorded) * car.route.laps
    return frames * len(prepared.scenario.methods)
