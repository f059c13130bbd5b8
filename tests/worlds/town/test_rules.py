"""Rules of a town: what is refused at which border, and the numbers that follow from them."""

from __future__ import annotations

import math
from array import array
from typing import Any

import numpy as np
import pytest

from genie_sim.base.settings import SettingError
from genie_sim.worlds.scene.noise import SMOOTH_MASK, mix, normals, smooth_normals
from genie_sim.worlds.town.rules import TownRules


@pytest.mark.parametrize(
    ("right", "wrong", "message"),
    [
        ({"blocks": [1, 100]}, {"blocks": [0, 1]}, "blocks: [0, 1] is not two whole numbers"),
        ({"blocks": (1, 1)}, {"blocks": (1, 101)}, "is not two whole numbers from 1 to 100"),
        ({}, {"blocks": (True, 2)}, "is not two whole numbers"),
        ({}, {"blocks": (1, 2, 3)}, "is not two whole numbers"),
        ({"view_m": 100}, {"view_m": 100.5}, "view: 100.5 m is more than 100 m"),
        ({"view_m": 0.5}, {"view_m": 0}, "view: 0.0 m is not positive"),
        ({}, {"speed_mps": 0}, "speed_mps: 0.0 is not positive"),
        ({}, {"braking_mps2": -1.0}, "braking_mps2: -1.0 is not positive"),
        ({}, {"speed_mps": math.inf}, "speed_mps: inf is not a finite number"),
        ({}, {"speed_mps": True}, "speed_mps: True is not a finite number"),
        ({}, {"speed_mps": "8"}, "speed_mps: '8' is not a finite number"),
        ({"main_every": 1}, {"main_every": 0}, "main_every: 0 is not a whole number from 1 on"),
        ({"destinations": 1}, {"destinations": 1.5}, "destinations: 1.5 is not a whole number"),
        ({"walkers_per_100m": 0}, {"walkers_per_100m": -1}, "is not between 0 and 100"),
        ({"cyclists_per_100m": 100}, {"cyclists_per_100m": 101}, "is not between 0 and 100"),
        ({"popularity": 0}, {"popularity": -0.1}, "popularity: -0.1 is negative"),
        ({"truck_share": 1}, {"truck_share": 1.1}, "truck_share: 1.1 is not between 0 and 1"),
        ({"truck_share": 0}, {"truck_share": -0.1}, "truck_share: -0.1 is not between 0 and 1"),
        ({"street_half_m": 8}, {"street_half_m": 7.9}, "a quarter of a block, 37.5 m"),
        ({"street_half_m": 37.5}, {"street_half_m": 37.6}, "a quarter of a block, 37.5 m"),
    ],
)
def test_a_rule_holds_up_to_its_border(right: Any, wrong: Any, message: str):
    TownRules(**right)
    with pytest.raises(SettingError) as error:
        TownRules(**wrong)
    assert message in str(error.value)


def test_a_block_is_long_enough_to_stop_in_from_the_higher_limit():
    """20 m/s are 100 m of braking at 2 m/s², and two junctions of 12 m."""
    few = {"parked_cars_per_100m": 0.0, "main_speed_mps": 20.0}
    TownRules(block_m=124.0, **few)
    with pytest.raises(
        SettingError, match="too short to stop in from the speed limit; at least 124 m"
    ):
        TownRules(block_m=123.9, **few)
    with pytest.raises(SettingError, match="at least 124 m"):
        TownRules(block_m=123.9, speed_mps=20.0, parked_cars_per_100m=0.0)


def test_parked_cars_have_room_between_junctions():
    """122 of 150 m are free, 18 slots of 6.5 m on each side: 24 cars per 100 m."""
    rules = TownRules(parked_cars_per_100m=24.0)
    assert rules.parking_slots == 18
    with pytest.raises(SettingError, match=r"do not fit; between junctions there is room for 24.0"):
        TownRules(parked_cars_per_100m=24.1)


def test_whole_numbers_are_the_same_town_and_streets_have_their_limits():
    assert TownRules(view_m=60, blocks=[8, 8]) == TownRules(view_m=60.0, blocks=(8, 8))  # type: ignore[arg-type]
    rules = TownRules(main_every=3)
    assert [rules.main(street) for street in range(5)] == [True, False, False, True, False]
    assert rules.limit_mps(3) == rules.main_speed_mps > rules.limit_mps(4) == rules.speed_mps


def test_mixed_keys_are_those_of_splitmix64():
    """The first numbers of SplitMix64 from 0 (its reference implementation)."""
    step = 0x9E3779B97F4A7C15
    found = [mix(n * step % 2**64) for n in range(3)]
    assert found == [0xE220A8397B1DCDAF, 0x6E789E6AA1B965F4, 0x06C45D188009454F]


def test_numbers_are_standard_normal_and_neighbours_correlated():
    table = np.array(normals())
    assert len(table) == 4096 and (np.diff(table) > 0).all()
    assert table.mean() == pytest.approx(0.0, abs=1e-9)
    assert table.std() == pytest.approx(1.0, abs=2e-3)
    row = smooth_normals(0.1)
    assert isinstance(row, array) and len(row) == SMOOTH_MASK + 1
    values = np.array(row)
    assert values.mean() == pytest.approx(0.0, abs=0.05)
    assert values.std() == pytest.approx(1.0, abs=0.03)
    for apart in (1, 5, 20):
        correlation = np.corrcoef(values[:-apart], values[apart:])[0, 1]
        assert correlation == pytest.approx(math.exp(-0.1 * apart), abs=0.03)
