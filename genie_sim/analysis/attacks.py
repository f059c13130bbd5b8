"""What attacks did: how much of what attackers forged others held.

A false object counts as poisoned where an object of its class was added within ``NEAR_M``, from the
first message that told it until ``AFTER_NS`` after the last; a missed object counts as suppressed
where one was left out. Objects may be there by chance: what they are without an attack is measured
with ``applied: false``.
"""

from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from genie_sim.analysis.correctness import CAUSES
from genie_sim.analysis.metric import LOWER, Metric, Views, Where
from genie_sim.analysis.statistics import Measured
from genie_sim.base.grid import Grid, area_around
from genie_sim.base.units import NS_PER_S
from genie_sim.core.classes import class_of
from genie_sim.record.columns import Columns
from genie_sim.record.records import CONSUMER
from genie_sim.record.results import MethodInfo

NEAR_M = 2.0  # as far as what is held may be from what is there
AFTER_NS = 10 * NS_PER_S
ATTACKS = "Attacks"


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


class AtCars(NamedTuple):
    """What these cars held of what was added, and missed of what was left out, and for how long
    each drove after the first attack, summed over them [s].
    """

    added: Sequence[Hold]
    left_out: Sequence[Hold]
    cars: Collection[str]
    seconds: float


# What is read to find the forged objects that consumers hold, and for how long.
HELD_FORGERIES = (
    "attacks: attacker, receiver, change, label, east_m, north_m, begin_ns, end_ns; "
    "held_objects: car, label, judged, east_m, north_m, begin_ns, end_ns"
)


def views(
    tables: Mapping[str, Columns], methods: Mapping[str, MethodInfo], intervals: bool
) -> Views:
    """All attacks of each method; the component says at which cars: ``attackers``, ``receivers``
    (those to which an attacker sends messages itself) or ``others`` (all that do not attack,
    receivers included).
    """
    if not {"attacks", "held", "held_objects"} <= tables.keys():
        return
    attacks, held, held_objects = (tables[name] for name in ("attacks", "held", "held_objects"))
    for method in methods:
        forgeries = attacks.where(method=method)
        instants = held.where(method=method, what=CONSUMER)
        if not len(forgeries) or not len(instants):
            continue
        begin_ns = int(forgeries["begin_ns"].min())
        stamps_ns = {car: of_car["stamp_ns"] for car, of_car in instants.groups("car")}
        driven_ns = {
            car: (float(stamps.min()), float(stamps.max())) for car, stamps in stamps_ns.items()
        }
        after_ns = {
            car: max(last_ns - max(begin_ns, first_ns), 0.0)
            for car, (first_ns, last_ns) in driven_ns.items()
        }
        cars, attackers = set(stamps_ns), set(forgeries["attacker"].unique())
        groups = {
            "attackers": cars & attackers,
            "receivers": cars & set(forgeries["receiver"].unique()),
            "others": cars - attackers,
        }
        rows = held_objects.where(method=method)
        false_objects = rows.rows(rows["judged"].isin(CAUSES))
        added = list(_holds(forgeries.where(change="added"), false_objects, driven_ns))
        left_out = list(
            _holds(forgeries.where(change="left_out"), rows.where(judged="missed"), driven_ns)
        )
        for component, members in groups.items():
            seconds = sum(after_ns[car] for car in members) / NS_PER_S
            yield Where(method, component=component), AtCars(added, left_out, members, seconds)


def _holds(
    forgeries: Columns, rows: Columns, driven_ns: Mapping[str, tuple[float, float]]
) -> Iterator[Hold]:
    """The rows of ``held_objects`` that a forgery explains; each by the first of them. What does
    not end is held until its car's last instant; ``driven_ns`` has the first and the last of each.
    """
    places: Grid[Place] = Grid(2 * NEAR_M)
    columns = (forgeries[name].tolist() for name in ("east_m", "north_m", "begin_ns", "end_ns"))
    for number, (label, *values) in enumerate(
        zip(forgeries["label"].tolist(), *columns, strict=True)
    ):
        place = Place(number, class_of(label), *values)
        places.add(places.cell(place.east_m, place.north_m), place)
    columns = (rows[name].tolist() for name in ("east_m", "north_m", "begin_ns"))
    for car, label, end_ns, east_m, north_m, begin_ns in zip(
        rows["car"].tolist(),
        rows["label"].tolist(),
        rows.floats("end_ns").tolist(),
        *columns,
        strict=True,
    ):
        if np.isnan(end_ns):
            end_ns = driven_ns[car][1]
        near = [
            place
            for place in places.inside(area_around(east_m, north_m, NEAR_M))
            if place.label == class_of(label)
            and (place.east_m - east_m) ** 2 + (place.north_m - north_m) ** 2 <= NEAR_M**2
            and place.begin_ns < end_ns
            and begin_ns < place.end_ns + AFTER_NS
        ]
        if near:
            first = min(near, key=lambda place: (place.begin_ns, place.number))
            since_ns = max(begin_ns, first.begin_ns, driven_ns[car][0])
            yield Hold(car, first.number, since_ns, end_ns)


class PoisonedObjects(Metric):
    """False objects where attackers added an object: mean number, per car that drives since the
    first attack, at attackers, receivers or others (the component).
    """

    title = "poisoned objects held"
    unit = "objects"
    better = LOWER
    section = ATTACKS
    view = AtCars
    reads = HELD_FORGERIES

    def holds(self, view: AtCars) -> Sequence[Hold]:
        """Those that count, of all cars."""
        return view.added

    def of(self, view: AtCars) -> Measured:
        spans_ns = (
            hold.end_ns - hold.begin_ns for hold in self.holds(view) if hold.car in view.cars
        )
        held_s = sum(spans_ns) / NS_PER_S
        return Measured(held_s / view.seconds if view.seconds > 0 else None, n=len(view.cars))


class SuppressedObjects(PoisonedObjects):
    """Missed objects that attackers left out: mean number, per car that drives since the first
    attack, at attackers, receivers or others (the component).
    """

    title = "suppressed objects"

    def holds(self, view: AtCars) -> Sequence[Hold]:
        return view.left_out


METRICS = {
    "poisoned_objects": PoisonedObjects(),
    "suppressed_objects": SuppressedObjects(),
}
