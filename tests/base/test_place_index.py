"""Places of items against a search through all of them, in plain Python and in C."""

import math
import random

import pytest

from genie_sim.base.grid import area_around
from genie_sim.base.place_index import PlaceIndex

Item = tuple[int, str, float, float]
REACH_M = 1.5


def items(count: int, reach_m: float, seed: int) -> list[Item]:
    """Some at the very same places, some on the borders of cells."""
    source = random.Random(seed)
    places = [
        (source.uniform(-reach_m, reach_m), source.uniform(-reach_m, reach_m)) for _ in range(count)
    ]
    places += [(float(round(east_m)), float(round(north_m))) for east_m, north_m in places[::3]]
    places += places[::7]
    return [(number, source.choice("ab"), *place) for number, place in enumerate(places)]


def filled(cell_m: float, rows: list[Item]) -> PlaceIndex[Item]:
    index: PlaceIndex[Item] = PlaceIndex(cell_m, REACH_M)
    for item in rows:
        index.add(item, *item[1:])
    return index


@pytest.mark.parametrize("cell_m", [2.0, 7.3, 50.0])
@pytest.mark.parametrize("removed", [0, 2, 3])
def test_what_is_at_a_place(cell_m: float, removed: int):
    """Also after every second or third item has been removed."""
    rows = items(300, 20.0, seed=1)
    index = filled(cell_m, rows)
    for item in rows[::removed] if removed else ():
        index.remove(item, *item[1:])
    left = [item for item in rows if not removed or item[0] % removed]
    assert sorted(index) == left
    for _, kind, east_m, north_m in items(200, 22.0, seed=2):
        distances2_m2 = {item: (item[2] - east_m) ** 2 + (item[3] - north_m) ** 2 for item in left}
        near = [item for item in left if distances2_m2[item] <= REACH_M**2]
        assert index.at(east_m, north_m) == near
        of_kind = [item for item in near if item[1] == kind]
        assert index.nearest(kind, east_m, north_m) == min(
            of_kind, key=distances2_m2.__getitem__, default=None
        )
        assert index.nearest(None, east_m, north_m) == min(
            near, key=distances2_m2.__getitem__, default=None
        )


@pytest.mark.parametrize("cell_m", [2.0, 7.3, 50.0])
@pytest.mark.parametrize("half_deg", [20.0, 40.0, 90.0, 180.0])
def test_a_sector_has_its_items_cell_by_cell(cell_m: float, half_deg: float):
    """West to east, in each column south to north, in each cell as they were added; items on the
    sector's borders, too.
    """
    rows, range_m = items(300, 20.0, seed=3), 15.0
    index = filled(cell_m, rows)
    min_cosine = math.cos(math.radians(half_deg))
    for _, _, east_m, north_m in items(60, 20.0, seed=4):
        for ahead in ((1.0, 0.0), (-0.6, 0.8), (math.cos(2.0), math.sin(2.0))):
            visible = []
            for item in rows:
                away_east_m, away_north_m = item[2] - east_m, item[3] - north_m
                ahead_m = away_east_m * ahead[0] + away_north_m * ahead[1]
                distance_m = math.hypot(away_east_m, away_north_m)
                if ahead_m < 0.0 <= min_cosine:
                    continue
                if distance_m <= range_m and ahead_m >= min_cosine * distance_m:
                    visible.append(item)
            visible.sort(key=lambda item: (item[2] // cell_m, item[3] // cell_m, item[0]))
            box = area_around(east_m, north_m, range_m)
            found = index.in_sector(box, (east_m, north_m), ahead, min_cosine, range_m)
            assert found == visible


def test_cells_are_those_of_whole_division():
    """``//`` rounds in a way of its own: 1.0 // 0.1 is 9.0, for 0.1 is more than a tenth."""
    at_m = [number / 10 for number in range(-30, 31)]
    rows = [(number, "a", east_m, 0.0) for number, east_m in enumerate(reversed(at_m))]
    index: PlaceIndex[Item] = filled(0.1, rows)
    found = index.in_sector((-9.0, -1.0, 9.0, 1.0), (0.0, 0.0), (1.0, 0.0), -2.0, 9.0)
    assert found == sorted(rows, key=lambda item: (item[2] // 0.1, item[0]))


@pytest.mark.parametrize("place_m", [1e300, 1e17])
def test_a_place_beyond_the_earth_does_no_harm(place_m: float):
    rows = items(20, 5.0, seed=5)
    index = filled(50.0, rows)
    assert index.nearest(None, place_m, 0.0) is None and index.at(0.0, place_m) == []
    lost = (99, "a", place_m, -place_m)
    index.add(lost, *lost[1:])
    assert lost in list(index)
    whole = index.in_sector((-4e7, -4e7, 4e7, 4e7), (0.0, 0.0), (1.0, 0.0), -2.0, 9.0)
    assert sorted(whole) == rows


def test_what_is_not_there_cannot_be_removed():
    index: PlaceIndex[str] = PlaceIndex(50.0, REACH_M)
    index.add("bench", "furniture", 1.0, 2.0)
    with pytest.raises(KeyError):
        index.remove("bench", "furniture", 101.0, 2.0)
    with pytest.raises(ValueError):
        index.remove("car", "furniture", 1.0, 2.0)
    assert list(index) == ["bench"]
