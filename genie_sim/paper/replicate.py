"""Many runs of the paper's evaluation in parallel processes; of each run, the numbers that claims and sweeps need.

A ``Job`` is one scenario under a list of settings with one seed. Settings are overrides as on the command line, and a
few words of the evaluation's own (``overlap=0.4``, ``laps=2``: ``WORDS``). Results come back in the order of the jobs,
whatever the number of processes.
"""

import functools
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from typing import TypeVar

from genie_sim import build, files
from genie_sim.build import Prepared
from genie_sim.errors import UserError, unknown
from genie_sim.paper import quality
from genie_sim.paper.facts import METHODS, Facts, facts_of
from genie_sim.paper.watch import Watch
from genie_sim.parallel import in_processes
from genie_sim.perception.sources import Recordings
from genie_sim.perception.trace import Trace, TraceFrame, read_trace
from genie_sim.recording.columns import Columns
from genie_sim.recording.log import Log
from genie_sim.recording.records import Tables
from genie_sim.runner import gc_disabled, held_of, on_frames
from genie_sim.scenario.scenario import Scenario, load_scenario
from genie_sim.sim.world import World

ROUTE_S = 5.2  # assumptions.yaml: evaluation.route
STREET_S = 3 * ROUTE_S  # of the 15.8 s that are recorded
GOLDEN = (5**0.5 - 1) / 2
CUT_S = 2.5  # when `link=cut` cuts the links: in mid run
RECORDED_HZ = 10.0
QUADRO = "quadro_rtx_4000"
SERVERS = ("one", "all", "shared")

EVERY_METHOD = tuple(method.name for method in METHODS)

Progress = Callable[[float, float, str], None]
T = TypeVar("T")
Work = TypeVar("Work")


@dataclass(frozen=True, slots=True)
class Job:
    """One run. ``keep_tables``: the frames and look-ups come back too, for figures. ``judged``: what consumers hold is
    compared with what is really there, which takes half as long again. ``redefined``: the facts of other definitions of
    metrics than the default's, too."""

    scenario: str
    seed: int
    settings: tuple[str, ...] = ()
    methods: tuple[str, ...] = EVERY_METHOD
    keep_tables: bool = False
    judged: bool = False
    redefined: bool = True


@dataclass(frozen=True)
class Outcome:
    """What a job gave."""

    facts: Facts
    frames: Columns | None = None
    lookups: Columns | None = None


Simulate = Callable[
    [Sequence[Job], str], list[Outcome]
]  # jobs, and what they are for, for the progress bar


def in_parallel(
    run: Callable[[Work], T],
    jobs: Sequence[Work],
    workers: int,
    progress: Progress | None = None,
    what: str = "runs",
) -> list[T]:
    """``run`` of each job, in the order of the jobs; ``progress`` is told how many are done, of how many. Ctrl-C stops
    all processes."""
    done: list[T] = []
    with closing(in_processes(run, jobs, workers)) as results:
        for outcome in results:
            done.append(outcome)
            if progress is not None:
                progress(len(done), len(jobs), what)
    return done


def run_job(job: Job) -> Outcome:
    """Simulates one job and computes its facts."""
    return outcome_of(prepare_job(job), job.keep_tables, job.redefined)


def outcome_of(prepared: Prepared, keep_tables: bool = False, redefined: bool = True) -> Outcome:
    """Simulates what is prepared and computes its facts."""
    tables = Tables()
    watch = Watch(prepared.scenario.genie)
    judged: set[str] = set()
    for method in prepared.scenario.methods:
        setup = build.setup(prepared, method)
        held = held_of(prepared, method.name, setup, tables, judged)
        with gc_disabled():
            world = World(
                setup,
                build.method(method),
                Log(method.name, tables, samples="processors", held=held),
            )
            watch.before(method.name, world)
            world.run()
            watch.after(world)
            judged.update(prepared.drives)
            world.dismantle()
    frames, lookups, resources = (
        table.columns() for table in (tables.frames, tables.lookups, tables.resources)
    )
    facts = facts_of(frames, lookups, resources, redefined)
    facts |= quality.facts_of(tables.held.columns()) | watch.facts()
    return Outcome(facts, frames, lookups) if keep_tables else Outcome(facts)


def prepare_job(job: Job) -> Prepared:
    """The scenario, devices and traces of a job. Raises ``UserError``."""
    words, overrides = _split(job.settings)
    own = [f"methods=[{', '.join(job.methods)}]", f"record=[{'held' if job.judged else ''}]"]
    overrides = [*_expanded(_plain(job.scenario), words, job.seed), *own, *overrides]
    scenario = load_scenario(job.scenario, overrides, job.seed)
    name = str(scenario.perception.parameters["trace"])
    recordings = _recordings(
        name, float(words.get("min_score", 0.0)), float(words.get("frame_rate_hz", 0))
    )
    return on_frames(scenario, recordings)


WORDS = (
    "overlap", "gate_m", "order", "same_bag_s", "laps", "similarity", "quadro", "all_edges", "links", "link",
    "image_cell_m", "view_range_m", "min_score", "frame_rate_hz", "server",
)  # fmt: skip
_plain = functools.lru_cache(load_scenario)


def _split(settings: Sequence[str]) -> tuple[dict[str, str], list[str]]:
    """The evaluation's own words (the last one counts), and plain overrides."""
    words: dict[str, str] = {}
    overrides = []
    for setting in settings:
        name, _, value = setting.partition("=")
        if name in WORDS:
            words[name] = value
        else:
            overrides.append(setting)
    return words, overrides


def _expanded(scenario: Scenario, words: Mapping[str, str], seed: int) -> Iterator[str]:
    """The evaluation's own words as overrides of the scenario."""
    cars = scenario.cars
    if "overlap" in words:
        yield from _routes(scenario, float(words["overlap"]), words.get("order"), seed)
    for index in range(len(cars)):
        if "same_bag_s" in words:  # all of the drive, begun this much after the car before
            yield f"cars[{index}].route.window=null"
            yield f"cars[{index}].route.start={index * float(words['same_bag_s']):g} s"
        if "laps" in words:
            yield f"cars[{index}].route.laps={words['laps']}"
        if "links" in words:
            yield f"cars[{index}].link={words['links']}"
    if words.get("link") == "cut":
        cuts = [f"{{fault: outage, target: {car.name}, begin: {CUT_S} s}}" for car in cars]
        yield f"faults=[{', '.join(cuts)}]"
    yield from _edges(scenario, words)
    if "links" in words:
        yield f"edge_network={words['links']}"
    if "gate_m" in words:
        yield f"genie.object_map.gate={words['gate_m']} m"
    if "similarity" in words and all(
        car.cameras for car in cars
    ):  # of pictures; phantom Genies have positions only
        yield f"genie.similarity={words['similarity']}"
    if "image_cell_m" in words:
        yield f"genie.similarity={{name: pose_grid, cell: {words['image_cell_m']} m}}"
    if "view_range_m" in words:
        yield f"genie.view_range={words['view_range_m']} m"


def _edges(scenario: Scenario, words: Mapping[str, str]) -> Iterator[str]:
    """The devices of edges. ``server``: in heterogeneous scenarios ``one`` edge is the powerful server, ``all`` are, or
    one is ``shared`` by all cars."""
    server, quadro = words.get("server", SERVERS[0]), words.get("quadro", QUADRO)
    if server not in SERVERS:
        raise UserError(f"server: {unknown('server', server, SERVERS)}")
    heterogeneous = any(edge.device == QUADRO for edge in scenario.edges)
    if server == "shared" and heterogeneous:
        yield f"edges=[{{name: edge1, device: {words.get('all_edges', quadro)}}}]"
        yield from (f"cars[{index}].edge=edge1" for index in range(len(scenario.cars)))
        return
    for index, edge in enumerate(scenario.edges):
        if "all_edges" in words:
            yield f"edges[{index}].device={words['all_edges']}"
        elif edge.device == QUADRO or (server == "all" and heterogeneous):
            yield f"edges[{index}].device={quadro}"


def _routes(scenario: Scenario, overlap: float, order: str | None, seed: int) -> Iterator[str]:
    """Each car (1 - overlap) of a route ahead of the one before it; a car without cameras drives behind the others.

    Where on the recorded street the last car begins depends on the seed: multiples of the golden ratio spread evenly,
    however many seeds there are. So one car and three see, over the seeds, the same street.
    """
    places = list(range(len(scenario.cars)))
    if (order == "reversed") != any(not car.cameras for car in scenario.cars):
        places.reverse()
    step_s = (1.0 - overlap) * ROUTE_S
    first_s = (STREET_S - ROUTE_S - step_s * (len(places) - 1)) * (seed * GOLDEN % 1.0)
    for index, place in enumerate(places):
        begin_s = first_s + place * step_s
        yield f"cars[{index}].route.window=[{begin_s:.3f} s, {begin_s + ROUTE_S:.3f} s]"


@functools.lru_cache(maxsize=32)
def _recordings(name: str, min_score: float, rate_hz: float) -> Recordings:
    """A trace with fewer detections (weaker ones left out) or fewer frames (every n-th kept). What is really there is
    known of the whole one."""
    path = files.find(files.TRACE, name)
    if not min_score and not rate_hz:
        return Recordings(read_trace(path), path=path)
    whole = _recordings(name, 0.0, 0.0).main
    every = round(RECORDED_HZ / rate_hz) if rate_hz else 1

    def kept(frame: TraceFrame) -> TraceFrame:
        return replace(
            frame, detections=tuple(one for one in frame.detections if one.score >= min_score)
        )

    frames = {
        camera: tuple(map(kept, sequence[::every])) for camera, sequence in whole.frames.items()
    }
    return Recordings(Trace(whole.name, whole.origin, frames, whole.provenance))


class TimeLeft:
    """Progress over several batches of jobs, in jobs; forwards to a progress bar."""

    def __init__(self, total: int, progress: Progress | None) -> None:
        self._total = total
        self._before = 0
        self._progress = progress
        self.began_s = time.perf_counter()

    def __call__(self, done: float, of: float, what: str) -> None:
        if self._progress is not None:
            self._progress(self._before + done, max(self._total, self._before + of), what)
        if done == of:
            self._before += int(of)
