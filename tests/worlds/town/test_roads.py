"""How cars drive through a generated town, and what moves beside them."""

from __future__ import annotations

import itertools
import math
from types import SimpleNamespace

import numpy as np
import pytest

from genie_sim.base.classes import VEHICLES
from genie_sim.base.units import NS_PER_S
from genie_sim.worlds.town import Town, TownRules
from genie_sim.worlds.town.commuting import Commuting
from genie_sim.worlds.town.routes import CYCLE_S, green_at
from genie_sim.worlds.town.rules import JUNCTION_M
from tests.worlds.town.town_truth import truth_near

RULES = TownRules(blocks=(6, 5))
STEP_NS = NS_PER_S // 10


@pytest.fixture(scope="module")
def town() -> Town:
    return Town(RULES, seed=3)


def test_speeds_are_those_of_a_town(town):
    """Of 12 cars over five minutes, ten times a second: 14 to 36 km/h, stops included."""
    t_s = np.arange(0, 300, 0.1)
    courses = [town.drive(f"car{k}", 300 * NS_PER_S).course for k in range(12)]
    speeds_mps = np.concatenate([course.at(t_s).speed_mps for course in courses])
    assert 4.0 < speeds_mps.mean() < 10.0
    assert 0.02 < (speeds_mps < 0.1).mean() < 0.5, "there are stops, but cars get on"


def test_a_light_is_green_for_one_street_at_a_time():
    for t_s in np.arange(0, 2 * CYCLE_S, 0.5):
        assert green_at((4, 8), True, t_s) > t_s or green_at((4, 8), False, t_s) > t_s
        for northbound in (False, True):
            green_s = green_at((4, 8), northbound, t_s)
            assert t_s <= green_s < t_s + CYCLE_S
            assert green_at((4, 8), northbound, green_s + 1e-6) == green_s + 1e-6


@pytest.mark.parametrize("slow", [{}, {"braking_mps2": 0.15, "block_m": 700.0}])
def test_no_car_drives_into_a_red_light(slow):
    """Of six cars in a town with lights at all junctions: each is green within the tenth of a
    second in which a car drives in, also where cars brake for longer than a light is green.
    """
    rules, step_s, entries = TownRules(blocks=(3, 3), main_every=1, **slow), 0.1, 0
    town = Town(rules, seed=2)
    for k in range(6):
        drive = town.drive(f"car{k}", 600 * NS_PER_S)
        way = np.array([drive.position(t_ns) for t_ns in range(0, drive.duration_ns, STEP_NS)])
        nodes = np.rint(way / rules.block_m).astype(int)
        is_inside = (np.abs(way - nodes * rules.block_m) < JUNCTION_M - 1e-3).all(axis=1)
        for n in np.flatnonzero(np.diff(is_inside.astype(int)) > 0).tolist():
            east_m, north_m = np.abs(way[n + 1] - way[n])
            green_s = green_at(tuple(nodes[n + 1].tolist()), bool(north_m > east_m), n * step_s)
            assert green_s <= (n + 1) * step_s + 1e-6
            entries += 1
    assert entries > 20


def _overlap(rules: TownRules) -> float:
    """Of the sections that two cars pass in two minutes the share that both pass (Jaccard), mean of
    all pairs.
    """
    town = Town(rules, seed=5)
    passed = []
    for k in range(60):
        drive = town.drive(f"car{k}", 120 * NS_PER_S)
        places = [drive.position(t_ns) for t_ns in range(0, drive.duration_ns, NS_PER_S)]
        halves = {tuple(math.floor(2 * x / rules.block_m + 0.5) for x in place) for place in places}
        passed.append(halves)
    return float(np.mean([len(a & b) / len(a | b) for a, b in itertools.combinations(passed, 2)]))


def test_commuters_overlap_more_than_uniform_travellers():
    """1,770 pairs of cars, one seed, 8 x 8 blocks. Popular destinations and main streets bring cars
    together.
    """
    commuting = _overlap(TownRules(popularity=1.5, destinations=8))
    uniform = _overlap(TownRules(popularity=0.0, destinations=81, main_every=1))
    print(f"shared sections: commuters {commuting:.4f}, uniform {uniform:.4f}")
    assert commuting > 1.3 * uniform


def test_a_car_that_starts_at_the_one_popular_place_drives_elsewhere():
    """At 60 the share of the first destination is 1.0: no other is ever drawn."""
    random = np.random.default_rng(5)
    commuting = Commuting(TownRules(blocks=(1, 1), popularity=60.0), random)
    i, j = commuting.destination(0.0)
    first = np.array([(i + 0.5) / 2, (j + 0.5) / 2, 0.0])
    rest = itertools.repeat(0.5, 100_000)
    draws = SimpleNamespace(random=lambda count=None: first if count else next(rest))
    way = list(itertools.islice(commuting.trip(draws), 5))
    assert len({*way}) > 1 and all(math.dist(a, b) == 1 for a, b in itertools.pairwise(way))


LABELS = ("car", "truck", "bus", "person", "bicycle", "bench", "traffic light", "elephant")


@pytest.mark.parametrize("blocks", [(6, 5), (1, 2)])
@pytest.mark.parametrize("range_m", [2.0, 40.0])
def test_what_is_there_is_found_by_its_class(blocks, range_m):
    """At any places and times, on streets and beside them, within the town and outside."""
    town = Town(TownRules(blocks=blocks), seed=3)
    random = np.random.default_rng(5)
    count = 1200
    labels = [LABELS[k] for k in random.integers(0, len(LABELS), count)]
    east_m, north_m = (random.uniform(-60.0, size_m + 60.0, count) for size_m in town.size_m)
    on_street = slice(count // 2)
    middle_m = np.rint(east_m[on_street] / RULES.block_m) * RULES.block_m
    east_m[on_street] = middle_m + random.uniform(-9.0, 9.0, count // 2)
    t_ns = random.integers(0, 3600 * NS_PER_S, count)
    asked = zip(labels, east_m.tolist(), north_m.tolist(), t_ns.tolist(), strict=True)
    expected = [
        any(
            label == item.label or {label, item.label} <= set(VEHICLES)
            for item in truth_near(town, *place, range_m, at_ns)
        )
        for label, *place, at_ns in asked
    ]
    found = town.are_there(labels, east_m, north_m, t_s=t_ns * 1e-9, tolerance_m=range_m)
    assert found.tolist() == expected
    assert 5 < sum(expected) < count


def test_cyclists_are_a_bicycle_and_a_person(town):
    """One where the other is, and both as fast."""
    moving = [item for street in town.streets for item in street.objects if item.speed_mps]
    assert {item.label for item in moving} == {"car", "bicycle", "person"}
    ways = {
        label: {item[2:] for item in moving if item.label == label}
        for label in ("bicycle", "person")
    }
    assert ways["bicycle"] and ways["bicycle"] < ways["person"]


def test_densities_are_those_of_the_rules(town):
    """Cars per 100 m of street: 15 parked and 1 moving, within a fifth (one town of 11 km of
    streets).
    """
    everything = truth_near(town, 450.0, 375.0, 1000.0, 0)
    streets_m = (RULES.blocks[0] + 1) * town.size_m[1] + (RULES.blocks[1] + 1) * town.size_m[0]
    parked = sum(item.label in ("car", "truck") and not item.moving for item in everything)
    moving = sum(item.label == "car" and item.moving for item in everything)
    assert parked / streets_m * 100 == pytest.approx(RULES.parked_cars_per_100m, rel=0.2)
    assert moving / streets_m * 100 == pytest.approx(RULES.moving_cars_per_100m, rel=0.4)


@pytest.mark.parametrize(
    ("before", "here", "after"), [((0, 0), (1, 0), (2, 0)), ((1, 0), (1, 1), (1, 2))]
)
def test_a_car_drives_straight_on_where_a_turn_gains_nothing(before, here, after):
    even = TownRules(blocks=(4, 4), speed_mps=10.0, main_speed_mps=10.0)
    assert Commuting(even, np.random.default_rng(1)).after(before, here, (3, 3)) == after
