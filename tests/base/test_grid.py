"""The spatial hash against a search through all items."""

import random

import pytest

from genie_sim.base.grid import Grid, cell_counts


def places(count: int, reach_m: float, seed: int) -> list[tuple[float, float]]:
    source = random.Random(seed)
    return [
        (source.uniform(-reach_m, reach_m), source.uniform(-reach_m, reach_m)) for _ in range(count)
    ]


def filled(side_m: float, items: list[tuple[float, float]]) -> Grid[tuple[float, float]]:
    grid: Grid[tuple[float, float]] = Grid(side_m)
    for place in items:
        grid.add(grid.cell(*place), place)
    return grid


@pytest.mark.parametrize("side_m", [0.5, 2.0, 60.0])
@pytest.mark.parametrize("reach_m", [3.0, 300.0])
def test_a_rectangle_holds_what_a_search_finds(side_m: float, reach_m: float):
    """Whether the cells of the rectangle are walked or the occupied ones are searched."""
    items = places(200, 100.0, seed=1)
    grid = filled(side_m, items)
    assert sorted(grid) == sorted(items)
    for east_m, north_m in places(20, 100.0, seed=2):
        west, east, south, north = (
            east_m - reach_m,
            east_m + reach_m,
            north_m - reach_m,
            north_m + reach_m,
        )
        candidates = list(grid.inside((west, south, east, north)))
        inside = [one for one in items if west <= one[0] <= east and south <= one[1] <= north]
        assert set(inside) <= set(candidates)
        assert len(candidates) == len(set(candidates))
        for x, y in candidates:
            assert west - side_m <= x <= east + side_m
            assert south - side_m <= y <= north + side_m


@pytest.mark.parametrize("count", [10, 300])
def test_items_come_in_the_order_of_their_cells(count: int):
    """Of 100 cells, which are walked if there are many items, and else are searched for."""
    items = places(count, 20.0, seed=3)
    grid = filled(2.0, items)
    area = -9.0, -9.0, 9.0, 9.0
    assert list(grid.inside(area)) == [
        place for cell in grid.cells(area) for place in items if grid.cell(*place) == cell
    ]


def test_a_rectangle_as_large_as_the_earth_is_not_walked():
    """Its cells would take years."""
    grid = filled(2.0, places(50, 1000.0, seed=4))
    assert len(list(grid.inside((-4e7, -4e7, 4e7, 4e7)))) == 50


def test_removed_items_are_gone():
    grid: Grid[str] = Grid(1.0)
    cells = list(grid.cells((-0.5, 0.0, 0.5, 0.0)))
    assert len(cells) == 2
    for cell in cells:
        grid.add(cell, "bench")
    assert list(grid.at(-0.1, 0.1)) == list(grid.at(0.1, 0.1)) == ["bench"]
    grid.remove(cells[0], "bench")
    assert list(grid.at(-0.1, 0.1)) == []
    assert list(grid) == ["bench"]
    grid.remove(cells[1], "bench")
    assert list(grid.inside((-9.0, -9.0, 9.0, 9.0))) == []


@pytest.mark.parametrize(
    ("size_m", "counts"), [((240.0, 90.0), (2, 1)), ((10.0, 10.0), (1, 1)), ((0.0, 260.0), (1, 3))]
)
def test_a_map_has_as_many_cells_as_fit_it_best_and_one_at_least(size_m, counts):
    assert cell_counts((5.0, -7.0, 5.0 + size_m[0], size_m[1] - 7.0), 100.0) == counts
