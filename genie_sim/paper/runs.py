"""One run of the paper's evaluation through ``genie_sim.api``: a scenario under settings with a
seed, and the facts that come out.

Settings are overrides as on the command line, and a few words of the evaluation's own
(``overlap=0.4``, ``laps=2``: ``WORDS``).
"""

import functools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import genie_sim as gs
from genie_sim.base.errors import UserError, unknown
from genie_sim.base.parallel import in_processes
from genie_sim.base.progress import Progress
from genie_sim.paper import quality
from genie_sim.paper.facts import METHODS, Facts, facts_of
from genie_sim.paper.watch import WorldObserver
from genie_sim.record.columns import Columns
from genie_sim.scenario.scenario import Scenario
from genie_sim.sim.settings import Car

ROUTE_S = 5.2  # assumptions.yaml: evaluation.route
STREET_S = 3 * ROUTE_S  # of the 15.8 s that are recorded
GOLDEN = (5**0.5 - 1) / 2
CUT_S = 2.5  # when `link=cut` cuts the links: in mid run
QUADRO = "quadro_rtx_4000"
SERVERS = ("one", "all", "shared")

EVERY_METHOD = tuple(method.name for method in METHODS)


@dataclass(frozen=True)
class Outcome:
    """What came out of a run.

    Parameters
    ----------
    facts : dict
        The run's numbers.
    trace : str
        The digest of the trace that was played.
    tables : mapping of str to Columns
        ``frames`` and ``lookups`` of a run that is shown in figures.
    """

    facts: Facts
    trace: str = ""
    tables: Mapping[str, Columns] = field(default_factory=dict)


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
    shown : bool
        Whether figures show it: its tables are kept, and what consumers hold is compared with what
        is really there, which takes half as long again.
    """

    scenario: str
    seed: int
    settings: tuple[str, ...] = ()
    methods: tuple[str, ...] = EVERY_METHOD
    shown: bool = False

    def load(self) -> Scenario:
        """The scenario as it is run. Raises ``UserError``."""
        words, overrides = _split(self.settings)
        expanded = _expanded(_shipped(self.scenario), words, self.seed)
        tables = ["lookups", "resources", *(["held"] if self.shown else [])]
        fixed = [f"methods=[{', '.join(self.methods)}]", f"record=[{', '.join(tables)}]"]
        return gs.load_scenario(self.scenario, [*expanded, *fixed, *overrides], seed=self.seed)

    def simulate(self) -> Outcome:
        """Simulates it. Raises ``UserError``."""
        scenario = self.load()
        observer = WorldObserver(scenario.genie)
        run = gs.run(scenario, observer=observer)
        tables = run.tables
        facts = facts_of(tables["frames"], tables["lookups"], tables["resources"])
        facts |= quality.facts_of(tables["held"]) | observer.facts()
        kept = {name: tables[name] for name in ("frames", "lookups") if self.shown}
        return Outcome(facts, next(iter(run.facts["traces"].values())), kept)


def simulate(
    runs: Sequence[EvaluationRun], workers: int, progress: Progress | None = None
) -> Iterator[Outcome]:
    """What comes out of each run, in their order, from so many processes. Raises ``UserError``."""
    for done, outcome in enumerate(in_processes(EvaluationRun.simulate, runs, workers), start=1):
        if progress is not None:
            progress(done, len(runs), "evaluation")
        yield outcome


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
    "server",
)
_shipped = functools.lru_cache(gs.load_scenario)


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
            yield f"cars[{index}].route.start=0 s"
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
