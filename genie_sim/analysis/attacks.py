"""What attacks did: how much of what attackers forged others held, how many cars, and how long.

A ghost counts as poisoned where an object of its class was added within ``NEAR_M``, from the first
message that told it until ``AFTER_NS`` after the last; a missed object counts as suppressed where
one was left out. Objects may be there by chance: what they are without an attack is measured with
``applied: false``.
"""

from collections import defaultdict
from collections.abc import Collection, Iterable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from genie_sim.classes import class_of
from genie_sim.grid import Grid
from genie_sim.recording.columns import Columns
from genie_sim.recording.results import Metric
from genie_sim.units import NS_PER_S

NEAR_M = 2.0  # as far as what is held may be from what is there
AFTER_NS = 10 * NS_PER_S
GHOSTS = ("moved_away", "never_there", "duplicate")
SPREAD_S = 1.0  # a car that holds poison for so long has got it


class Place(NamedTuple):
    """Where and when an object was forged."""

    number: int
    label: str
    east_m: float
    north_m: float
    begin_ns: int
    end_ns: int


class Hold(NamedTuple):
    """A car holds a forged object, or misses one that was left out, for a time."""

    car: str
    forgery: int
    begin_ns: float
    end_ns: float


def of_attacks(
    attacks: Columns, held: Columns, held_objects: Columns, methods: Sequence[str]
) -> Iterator[Metric]:
    """Metrics of all attacks of each method; the component says at which cars: ``attackers``,
    ``receivers`` (those to which an attacker sends messages itself) or ``others`` (all that do not
    attack, receivers included).
    """
    for method in methods:
        forgeries = attacks.where(method=method)
        instants = held.where(method=method, what="consumer")
        if not len(forgeries) or not len(instants):
            continue
        begin_ns, last_ns = int(forgeries["begin_ns"].min()), float(instants["stamp_ns"].max())
        cars = set(instants["car"].unique())
        groups = {
            "attackers": cars & set(forgeries["attacker"].unique()),
            "receivers": cars & set(forgeries["receiver"].unique()),
            "others": cars - set(forgeries["attacker"].unique()),
        }
        rows = held_objects.where(method=method)
        ghosts = rows.rows(rows["judged"].isin(GHOSTS))
        added = list(_holds(forgeries.where(change="added"), ghosts, last_ns))
        left_out = list(
            _holds(forgeries.where(change="left_out"), rows.where(judged="missed"), last_ns)
        )
        seconds = (last_ns - begin_ns) / NS_PER_S
        for component, members in groups.items():
            where = (method, "all", component)
            yield _number("poisoned_objects", where, holds=added, cars=members, seconds=seconds)
            yield _number(
                "suppressed_objects", where, holds=left_out, cars=members, seconds=seconds
            )
        ends_ns = dict(enumerate(forgeries.where(change="added")["end_ns"].tolist()))
        yield from _of_others((method, "all", "others"), added, groups["others"], ends_ns)


def _holds(forgeries: Columns, rows: Columns, last_ns: float) -> Iterator[Hold]:
    """The rows of ``held_objects`` that a forgery explains; each by the first of them."""
    places: Grid[Place] = Grid(2 * NEAR_M)
    columns = (forgeries[name].tolist() for name in ("east_m", "north_m", "begin_ns", "end_ns"))
    for number, (label, *values) in enumerate(
        zip(forgeries["label"].tolist(), *columns, strict=True)
    ):
        place = Place(number, class_of(label), *values)
        places.add(places.cell(place.east_m, place.north_m), place)
    ends_ns = np.nan_to_num(rows.floats("end_ns"), nan=last_ns).tolist()
    columns = (rows[name].tolist() for name in ("east_m", "north_m", "begin_ns"))
    for car, label, end_ns, east_m, north_m, begin_ns in zip(
        rows["car"].tolist(), rows["label"].tolist(), ends_ns, *columns, strict=True
    ):
        area = east_m - NEAR_M, east_m + NEAR_M, north_m - NEAR_M, north_m + NEAR_M
        near = [
            place
            for place in places.inside(*area)
            if place.label == class_of(label)
            and (place.east_m - east_m) ** 2 + (place.north_m - north_m) ** 2 <= NEAR_M**2
            and place.begin_ns < end_ns
            and begin_ns < place.end_ns + AFTER_NS
        ]
        if near:
            first = min(near, key=lambda place: (place.begin_ns, place.number))
            yield Hold(car, first.number, max(begin_ns, first.begin_ns), end_ns)


def _number(
    metric: str,
    where: tuple[str, str, str],
    *,
    holds: Iterable[Hold],
    cars: Collection[str],
    seconds: float,
) -> Metric:
    """How many such objects one of these cars holds, or misses, on average over the time.

    Parameters
    ----------
    metric : str
        Its name.
    where : tuple of str
        Method, placement and component.
    holds : iterable of Hold
        Those of all cars.
    cars : collection of str
        The cars that count.
    seconds : float
        The time since the first attack began [s].
    """
    total_s = sum(hold.end_ns - hold.begin_ns for hold in holds if hold.car in cars) / NS_PER_S
    whole_s = seconds * len(cars)
    value = total_s / whole_s if whole_s > 0 else None
    return Metric(metric, *where, value=value, unit="objects", n=len(cars))


def _of_others(
    where: tuple[str, str, str],
    holds: Iterable[Hold],
    cars: Collection[str],
    ends_ns: dict[int, int],
) -> Iterator[Metric]:
    """Spread, exposure and life of what was added; ``ends_ns`` of each forgery."""
    spans: defaultdict[str, list[tuple[float, float]]] = defaultdict(list)
    lasts_ns: dict[int, float] = {}
    for hold in holds:
        if hold.car in cars:
            spans[hold.car].append((hold.begin_ns, hold.end_ns))
            lasts_ns[hold.forgery] = max(hold.end_ns, lasts_ns.get(hold.forgery, 0.0))
    exposures_s = [_union_ns(car_spans) / NS_PER_S for car_spans in spans.values()]
    reached = sum(exposure_s >= SPREAD_S for exposure_s in exposures_s)
    n = len(cars)
    yield Metric("poison_spread", *where, value=reached / n if n else None, unit="1", n=n)
    longest_s = max(exposures_s, default=0.0) if n else None
    yield Metric("poison_exposure", *where, value=longest_s, unit="s", n=n)
    lives_s = [max(0.0, last - ends_ns[number]) / NS_PER_S for number, last in lasts_ns.items()]
    life_s = float(np.mean(lives_s)) if lives_s else None
    yield Metric("poison_life", *where, value=life_s, unit="s", n=len(lives_s))


def _union_ns(spans: Iterable[tuple[float, float]]) -> float:
    """How long at least one of the spans lasts."""
    total_ns = reached_ns = 0.0
    for begin_ns, end_ns in sorted(spans):
        total_ns += max(0.0, end_ns - max(begin_ns, reached_ns))
        reached_ns = max(reached_ns, end_ns)
    return total_ns
