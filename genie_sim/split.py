"""Whether one method of a run can be split among processes, and which cars each of them gets."""

import itertools

from genie_sim import build
from genie_sim.scenario.methods import MethodEntry
from genie_sim.scenario.scenario import Scenario
from genie_sim.sim.share import EDGES
from genie_sim.units import NS_PER_MS, duration_text

# Methods whose hosts share nothing but messages, of which a frame's detections are all that counts.
METHODS = frozenset({"local", "remote", "paced_remote", "genie", "central", "deadline"})
# Tables that can be put together from those of several processes.
TABLES = frozenset({"lookups", "looks", "resources", "poses", "held"})
FAULTS = frozenset({"hand_over"})  # which act on a car and its links alone
MIN_DELAY_NS = NS_PER_MS // 10  # else processes would exchange more than they simulate
# Of the processor time of a fleet under Genie, about what the edges take; where cars are judged,
# these take more. A wrong share only makes one process wait for another.
EDGES_SHARE, EDGES_SHARE_JUDGED = 0.33, 0.2


def obstacle(scenario: Scenario, entry: MethodEntry) -> str:
    """Why a method of a scenario cannot be split, to stand behind "because"; empty if it can."""
    tables = sorted(set(scenario.record) - TABLES)
    faults = sorted({fault.fault.name for fault in scenario.faults} - FAULTS)
    if scenario.fleet is None:
        return "it has no fleet"
    if entry.method.name not in METHODS:
        return f"{entry.name} cannot be split"
    if tables:
        return f"it records {', '.join(tables)}"
    if scenario.judged != "first":
        return "every stream of a car is judged"
    if faults:
        return f"it has the fault {faults[0]}"
    if scenario.under(entry).image_encoding != "raw":
        return "images are encoded"
    if build.own_plugins(scenario):
        return "it runs code of its own"
    if delay_ns(scenario) < MIN_DELAY_NS:
        shortest = duration_text(MIN_DELAY_NS)
        link = scenario.fleet.link.name
        return f"a message may take less than {shortest} on the cars' link ({link})"
    return ""


def delay_ns(scenario: Scenario) -> int:
    """The least time that a message takes between a car of the fleet and an edge [ns]: for so long
    processes need not know of each other. 0 where the link does not tell.
    """
    assert scenario.fleet is not None
    return int(getattr(build.link_model(scenario.fleet.link), "min_delay_ns", 0))


def owners(scenario: Scenario, processes: int) -> dict[str, int]:
    """The process of each car. The first one has the edges, too, so fewer cars."""
    edges = EDGES_SHARE_JUDGED if "held" in scenario.record else EDGES_SHARE
    beside_edges = max(0.0, (1 / processes - edges) / (1 - edges))
    owner, due = {}, 0.0
    others = itertools.cycle(range(1, processes))
    for car in scenario.cars:
        due += beside_edges
        if due >= 1.0:
            due -= 1.0
            owner[car.name] = EDGES
        else:
            owner[car.name] = next(others)
    return owner
