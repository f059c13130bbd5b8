"""The runs of the paper's evaluation through ``genie_sim.api``: scenarios under settings with a
seed, and the facts that come out.

Settings are overrides as on the command line, and a few words of the evaluation's own
(``overlap=0.4``, ``laps=2``: ``WORDS``).
"""

import functools
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import genie_sim as gs
from genie_sim.base.errors import UserError, unknown
from genie_sim.base.parallel import in_processes
from genie_sim.base.progress import Progress
from genie_sim.base.settings import plain_data
from genie_sim.paper import quality, watch
from genie_sim.paper.facts import METHODS, Facts, facts_of
from genie_sim.paper.watch import WorldObserver
from genie_sim.record.columns import Columns, concat

ROUTE_S = 5.2  # assumptions.yaml: evaluation.route
STREET_S = 3 * ROUTE_S  # of the 15.8 s that are recorded
GOLDEN = (5**0.5 - 1) / 2
CUT_S = 2.5  # when `link=cut` cuts the links: in mid run
QUADRO = "quadro_rtx_4000"
SERVERS = ("one", "all", "shared")

EVERY_METHOD = tuple(method.name for method in METHODS)
TABLES = ("frames", "lookups", "resources", "held")
ABOUT = ("name", "description", "methods", "record")  # a scenario, but no number of it


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

    def load(self) -> gs.Scenario:
        """The scenario as it is run. Raises ``UserError``."""
        words, overrides = _split(self.settings)
        expanded = _expanded(_shipped(self.scenario), words, self.seed)
        tables = ["lookups", "resources", *(["held"] if self.shown else [])]
        fixed = [f"methods=[{', '.join(self.methods)}]", f"record=[{', '.join(tables)}]"]
        return gs.load_scenario(self.scenario, [*expanded, *fixed, *overrides], seed=self.seed)

    def simulate(self) -> Outcome:
        """Simulates it. Raises ``UserError``."""
        (outcome,) = _simulate_together([self])
        return outcome


class _Part(NamedTuple):
    """One method of a run, simulated."""

    tables: Mapping[str, Columns]
    observer: WorldObserver
    trace: str


def simulate(
    runs: Sequence[EvaluationRun], workers: int, progress: Progress | None = None
) -> list[Outcome]:
    """What comes out of each run, in their order, from so many processes. Raises ``UserError``.

    A method whose numbers are the same in several runs is simulated once: local execution knows no
    edges, and neither baseline what a Genie does. A process takes all runs in which cars do the
    same.
    """
    together: dict[str, list[EvaluationRun]] = {}
    for run in runs:
        together.setdefault(_decides(run.load(), "local"), []).append(run)
    outcomes: dict[EvaluationRun, Outcome] = {}
    done = in_processes(_simulate_together, list(together.values()), workers)
    for of_cars, made in zip(together.values(), done, strict=True):
        outcomes |= zip(of_cars, made, strict=True)
        if progress is not None:
            progress(len(outcomes), len(runs), "evaluation")
    return [outcomes[run] for run in runs]


def _simulate_together(runs: Sequence[EvaluationRun]) -> list[Outcome]:
    """What comes out of each run; those that are shown come first, as their parts hold more."""
    parts: dict[str, _Part] = {}
    outcomes = {run: _outcome(run, parts) for run in sorted(runs, key=lambda run: not run.shown)}
    return [outcomes[run] for run in runs]


def _outcome(run: EvaluationRun, parts: dict[str, _Part]) -> Outcome:
    """A run of parts, of which those that are missing are simulated."""
    scenario, of_run = run.load(), []
    for method in (entry.name for entry in scenario.methods):
        decides = _decides(scenario, method)
        if decides not in parts:
            observer = WorldObserver(scenario.genie)
            made = gs.run(scenario, methods=[method], observer=observer)
            trace = next(iter(made.facts["traces"].values()))
            parts[decides] = _Part(made.tables, observer, trace)
        of_run.append(parts[decides])
    tables = {name: concat([part.tables[name] for part in of_run]) for name in TABLES}
    facts = facts_of(tables["frames"], tables["lookups"], tables["resources"])
    facts |= watch.facts_of([part.observer for part in of_run])
    if run.shown:
        facts |= quality.facts_of(tables["held"])
    kept = {name: tables[name] for name in ("frames", "lookups") if run.shown}
    return Outcome(facts, of_run[0].trace, kept)


def _decides(scenario: gs.Scenario, method: str) -> str:
    """What decides the numbers of one of its methods, as text."""
    settings: dict[str, Any] = plain_data(scenario)
    ignored = [*ABOUT, *(("genie",) if method != "genie" else ())]
    if method == "local":
        settings["edges"] = [edge["name"] for edge in settings["edges"]]
    return json.dumps([method, {name: settings[name] for name in settings if name not in ignored}])


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


def _expanded(scenario: gs.Scenario, words: Mapping[str, str], seed: int) -> Iterator[str]:
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


def _edges(scenario: gs.Scenario, words: Mapping[str, str]) -> Iterator[str]:
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


def _windows(cars: Sequence[Any], words: Mapping[str, str], seed: int) -> Iterator[tuple[str, str]]:
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
