"""One run of the paper's evaluation, as a run of a study.

Settings are overrides as on the command line, and a few words of the evaluation's own
(``overlap=0.4``, ``laps=2``: ``WORDS``).
"""

import functools
import hashlib
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

from genie_sim import build, files
from genie_sim.analysis.metrics import with_fresh
from genie_sim.build import Prepared
from genie_sim.core.rules import GenieRules
from genie_sim.core.thresholds import RANGE_60
from genie_sim.errors import UserError, unknown
from genie_sim.paper import quality
from genie_sim.paper.definitions import USUAL, Definitions
from genie_sim.paper.facts import METHODS, Facts, facts_of
from genie_sim.paper.watch import WorldObserver
from genie_sim.perception.sources import Recordings
from genie_sim.perception.trace import Trace, TraceFrame, read_trace
from genie_sim.recording.log import Log
from genie_sim.recording.records import FRAMES, LOOKUPS, Tables, new_tables
from genie_sim.recording.results import Metric
from genie_sim.recording.tables import Schema
from genie_sim.runner import accuracy_of, gc_disabled, on_frames
from genie_sim.scenario.scenario import Scenario, load_scenario
from genie_sim.settings import plain_data
from genie_sim.sim.settings import Car
from genie_sim.sim.world import World
from genie_sim.study.run_ids import run_id_of
from genie_sim.study.tasks import Shared
from genie_sim.units import duration_ns

ROUTE_S = 5.2  # assumptions.yaml: evaluation.route
STREET_S = 3 * ROUTE_S  # of the 15.8 s that are recorded
GOLDEN = (5**0.5 - 1) / 2
CUT_S = 2.5  # when `link=cut` cuts the links: in mid run
RECORDED_HZ = 10.0
QUADRO = "quadro_rtx_4000"
SERVERS = ("one", "all", "shared")

EVERY_METHOD = tuple(method.name for method in METHODS)
GENIE_ALONE = ("genie",)
FIRST_SEED = 1
FRAMES_A_RUN = 1000  # about, under all methods; all runs are alike
KEPT_TABLES: dict[str, Schema] = {"frames": FRAMES, "lookups": LOOKUPS}


class SetupKey(NamedTuple):
    """What a run comes from besides its seed: the world as every method finds it, and how Genie
    works in it.
    """

    world: str
    genie: str


@dataclass(frozen=True, slots=True)
class EvaluationRun:
    """A scenario under a list of settings with one seed.

    Parameters
    ----------
    scenario : str
        The name of a shipped scenario.
    seed : int
        Seed of everything random, and where on the recorded street the cars begin.
    settings : tuple of str
        Overrides ``path=value``, and words of the evaluation's own; the last one counts.
    methods : tuple of str
        Of ``EVERY_METHOD``.
    keep_tables : bool
        Whether frames and look-ups are kept too, for figures.
    judged : bool
        Whether what consumers hold is compared with what is really there, which takes half as long
        again.
    definitions : tuple of Definitions
        What is meant by the metrics: the facts are computed under each of these.
    """

    scenario: str
    seed: int
    settings: tuple[str, ...] = ()
    methods: tuple[str, ...] = EVERY_METHOD
    keep_tables: bool = False
    judged: bool = False
    definitions: tuple[Definitions, ...] = (USUAL,)

    @property
    def run_id(self) -> str:
        """Names everything that decides the facts, the project's own code included."""
        wanted = (self.methods, self.keep_tables, self.judged, self.definitions)
        return run_id_of(self.setup_key, self.seed, wanted)

    @property
    def setup_key(self) -> SetupKey:
        """The same for all settings that make the same scenario, in whatever words."""
        return _setup_key(self.scenario, self.settings)

    @property
    def frames(self) -> float:
        return FRAMES_A_RUN

    @property
    def place(self) -> str:
        return f"{self.scenario} ({', '.join(self.settings) or 'as it is'}), seed {self.seed}"

    def judgement_id(self, definitions: Definitions) -> str:
        """Under which id the facts with these definitions are kept."""
        number = self.definitions.index(definitions)
        return f"{self.run_id}.{number}" if number else self.run_id

    def measure(self, shared: Shared, folder: Path) -> Mapping[str, Sequence[Metric]]:
        """Simulates it; the facts as metrics, by ``judgement_id``."""
        tables, facts_by_definitions = self.simulate()
        if self.keep_tables:
            for name in KEPT_TABLES:
                path = self.table_path(folder, name)
                path.parent.mkdir(parents=True, exist_ok=True)
                tables[name].write(path)
        return {
            self.judgement_id(definitions): metrics_of(facts)
            for definitions, facts in facts_by_definitions.items()
        }

    def table_path(self, folder: Path, name: str) -> Path:
        """Where a table that is kept lies, beside the parts in ``folder``."""
        return folder.with_name("tables") / f"{self.run_id}-{name}.parquet"

    def simulate(self) -> tuple[Tables, dict[Definitions, Facts]]:
        """The tables, and the facts under each of the definitions."""
        return simulated(self.prepare(), self.definitions)

    def facts(self) -> Facts:
        """Simulates it; the facts under the first of the definitions."""
        return self.simulate()[1][self.definitions[0]]

    def prepare(self) -> Prepared:
        """The scenario, devices and traces. Raises ``UserError``."""
        words, overrides = _split(self.settings)
        if any(override.startswith("cars") for override in overrides):
            scenario = _read(self)
        else:
            scenario = _with_seed(_of_first_seed(replace(self, seed=FIRST_SEED)), words, self.seed)
        recordings = _recordings(
            str(scenario.perception.parameters["trace"]),
            min_score=float(words.get("min_score", 0.0)),
            rate_hz=float(words.get("frame_rate_hz", 0)),
        )
        return on_frames(scenario, recordings)


def simulated(
    prepared: Prepared, definitions: Sequence[Definitions] = (USUAL,)
) -> tuple[Tables, dict[Definitions, Facts]]:
    """Simulates what is prepared: its tables, and its facts under each of the definitions."""
    tables = new_tables()
    observer = WorldObserver(prepared.scenario.genie)
    judged: set[str] = set()
    for method in prepared.scenario.methods:
        setup = build.setup(prepared, method)
        accuracy = accuracy_of(prepared, method.name, setup, tables, driven=judged)
        log = Log(method.name, tables, samples="processors", accuracy=accuracy)
        with gc_disabled():
            world = World(setup, build.method(method), log)
            observer.before(method.name, world)
            world.run()
            observer.after(world)
            judged.update(prepared.drives)
            world.dismantle()
    frames, lookups, resources, held = (
        tables[name].columns() for name in ("frames", "lookups", "resources", "held")
    )
    frames = with_fresh(frames, "answer")  # as the paper counts
    beside = quality.facts_of(held) | observer.facts()
    return tables, {one: facts_of(frames, lookups, resources, one) | beside for one in definitions}


def metrics_of(facts: Facts) -> list[Metric]:
    """Facts as rows of a part; which unit each has is known by those who ask for it."""
    return [
        Metric(*fact, value=None if math.isnan(value) else float(value), unit="")
        for fact, value in facts.items()
    ]


@functools.cache
def _setup_key(scenario: str, settings: tuple[str, ...]) -> SetupKey:
    """What makes one scenario with one seed makes one with every seed: all that a seed decides is
    where on the street the cars begin, and what is random.
    """
    prepared = EvaluationRun(scenario, FIRST_SEED, settings).prepare()
    written = plain_data(prepared.scenario)
    world = {key: written[key] for key in written if key not in ("genie", "methods")}
    digests = prepared.frames.digests()
    driven = [digests[car] for car in prepared.drives]
    return SetupKey(
        hashlib.sha256(f"{world} {driven}".encode()).hexdigest(),
        str(_in_numbers(prepared.scenario.genie)),
    )


def _in_numbers(rules: GenieRules) -> GenieRules:
    """The same rules, C_T as the number that a word stands for."""
    if rules.object_map.threshold != "range_60":
        return rules
    return replace(rules, object_map=replace(rules.object_map, threshold=RANGE_60))


@functools.lru_cache(maxsize=1024)
def _of_first_seed(run: EvaluationRun) -> Scenario:
    """The scenario of a run that has the first seed, read and checked once for all seeds."""
    return _read(run)


def _read(run: EvaluationRun) -> Scenario:
    words, overrides = _split(run.settings)
    expanded = _expanded(_plain(run.scenario), words, run.seed)
    methods = f"methods=[{', '.join(run.methods)}]"
    record = f"record=[{'held' if run.judged else ''}]"
    return load_scenario(run.scenario, [*expanded, methods, record, *overrides], run.seed)


def _with_seed(scenario: Scenario, words: Mapping[str, str], seed: int) -> Scenario:
    """The scenario of the first seed with another one, on whose windows cars then drive where they
    drove on those of the first.
    """
    if "overlap" in words:
        first, own = (_windows(scenario.cars, words, number) for number in (FIRST_SEED, seed))
        windows = dict(zip(map(_in_ns, first), map(_in_ns, own), strict=True))
        cars = [
            replace(car, route=replace(car.route, window_ns=windows[car.route.window_ns]))
            if car.route.window_ns in windows
            else car
            for car in scenario.cars
        ]
        scenario = replace(scenario, cars=tuple(cars))
    return replace(scenario, seed=seed)


def _in_ns(window: tuple[str, str]) -> tuple[int, int]:
    begin, end = map(duration_ns, window)
    return begin, end


WORDS = (
    "overlap",
    "gate_m",
    "order",
    "same_bag_s",
    "laps",
    "similarity",
    "quadro",
    "all_edges",
    "links",
    "link",
    "image_cell_m",
    "view_range_m",
    "min_score",
    "frame_rate_hz",
    "server",
)
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
        for index, (begin, end) in enumerate(_windows(cars, words, seed)):
            yield f"cars[{index}].route.window=[{begin}, {end}]"
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
    # of pictures; phantom Genies have positions only
    if "similarity" in words and all(car.cameras for car in cars):
        yield f"genie.similarity={words['similarity']}"
    if "image_cell_m" in words:
        yield f"genie.similarity={{name: pose_grid, cell: {words['image_cell_m']} m}}"
    if "view_range_m" in words:
        yield f"genie.view_range={words['view_range_m']} m"


def _edges(scenario: Scenario, words: Mapping[str, str]) -> Iterator[str]:
    """The devices of edges. ``server``: in heterogeneous scenarios ``one`` edge is the powerful
    server, ``all`` are, or one is ``shared`` by all cars.
    """
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


def _windows(cars: Sequence[Car], words: Mapping[str, str], seed: int) -> Iterator[tuple[str, str]]:
    """When each car's part of the recording begins and ends: each drives (1 - overlap) of a route
    ahead of the one before it; a car without cameras drives behind the others.

    Where on the recorded street the last car begins depends on the seed: multiples of the golden
    ratio spread evenly, however many seeds there are. So one car and three see, over the seeds, the
    same street.
    """
    places = list(range(len(cars)))
    if (words.get("order") == "reversed") != any(not car.cameras for car in cars):
        places.reverse()
    step_s = (1.0 - float(words["overlap"])) * ROUTE_S
    first_s = (STREET_S - ROUTE_S - step_s * (len(places) - 1)) * (seed * GOLDEN % 1.0)
    for place in places:
        begin_s = first_s + place * step_s
        yield f"{begin_s:.3f} s", f"{begin_s + ROUTE_S:.3f} s"


@functools.lru_cache(maxsize=32)
def _recordings(name: str, min_score: float, rate_hz: float) -> Recordings:
    """A trace with fewer detections (weaker ones left out) or fewer frames (every n-th kept). What
    is really there is known of the whole one.
    """
    path = files.find(files.TRACE, name)
    if not min_score and not rate_hz:
        return Recordings(read_trace(path), path=path)
    whole = _recordings(name, 0.0, 0.0).main
    every = round(RECORDED_HZ / rate_hz) if rate_hz else 1

    def filtered(frame: TraceFrame) -> TraceFrame:
        strong = (detection for detection in frame.detections if detection.score >= min_score)
        return replace(frame, detections=tuple(strong))

    frames = {
        camera: tuple(map(filtered, sequence[::every])) for camera, sequence in whole.frames.items()
    }
    return Recordings(Trace(whole.name, whole.origin, frames, whole.provenance))
