"""Rules of a town: what is refused at which border, and the numbers that follow from them."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import pytest

from genie_sim.base.setting_errors import SettingError
from genie_sim.base.settings import from_plain
from genie_sim.worlds.scene.keys import mix, object_number
from genie_sim.worlds.town.rules import TownRules

# of a town of signs and ghosts alone
NOTHING = {field.name: 0 for field in fields(TownRules) if field.name.endswith("_per_100m")}


@pytest.mark.parametrize(
    ("right", "wrong", "message"),
    [
        ({"blocks": [1, 100]}, {"blocks": [0, 1]}, "blocks[0]: must be from 1 to 100, not 0"),
        ({"view": "100 m"}, {"view": "100.5 m"}, "view: must be more than 0 m and at most 100 m"),
        ({"block": "10 km"}, {"block": "11 km"}, "block: must be at most 10000 m, but is '11 km'"),
        ({}, {"blocks": [100, 100], "block": "10 km"}, "blocks: make about 56,772,504 objects"),
        ({}, {"blocks": [100, 100], "cyclists_per_100m": 100}, "make about 6,770,434 objects"),
        ({}, {"blocks": [100, 100], "block": "10 km"} | NOTHING, "make about 11,726,504 objects"),
        ({}, {"speed_mps": 0}, "speed_mps: must be more than 0 and at most 100, not 0"),
        ({}, {"main_speed_mps": 1e200}, "main_speed_mps: must be more than 0 and at most 100"),
        ({}, {"braking_mps2": 1e-310}, "braking_mps2: must be from 0.01 to 100, not 1e-310"),
        ({"main_every": 1}, {"main_every": 0}, "main_every: must be at least 1, not 0"),
        ({"walkers_per_100m": 0}, {"walkers_per_100m": -1}, "must be from 0 to 100, not -1"),
        ({"popularity": 0}, {"popularity": -0.1}, "popularity: must be at least 0, not -0.1"),
        ({"truck_share": 1}, {"truck_share": 1.1}, "truck_share: must be from 0 to 1, not 1.1"),
        ({"street_half": "8 m"}, {"street_half": "7.9 m"}, "a quarter of a block, 37.5 m"),
        ({"street_half": "37.5 m"}, {"street_half": "37.50001 m"}, "37.5 m, but is 37.50001 m"),
        ({}, {"block": "72.22222 m", "street_half": "8 m"}, "block: 72.22222 m is too short"),
        (
            {"block": "150.2 m", "parked_cars_per_100m": 23.9},
            {"block": "150.2 m", "parked_cars_per_100m": 24},
            "there is room for 23.9",
        ),
    ],
)
def test_a_rule_holds_up_to_its_border(right: Any, wrong: Any, message: str):
    from_plain(TownRules, right)
    with pytest.raises(SettingError) as error:
        from_plain(TownRules, wrong)
    assert message in str(error.value)


def test_a_block_is_long_enough_to_stop_in_from_the_higher_limit():
    """20 m/s are 100 m of braking at 2 m/s², and two junctions of 12 m."""
    few = {"parked_cars_per_100m": 0.0, "main_speed_mps": 20.0}
    TownRules(block_m=124.0, **few)
    with pytest.raises(
        SettingError, match="too short to stop in from the speed limit; at least 124 m"
    ):
        TownRules(block_m=123.9, **few)


def test_parked_cars_have_room_between_junctions():
    """122 of 150 m are free, 18 bays of 6.5 m on each side: 24 cars per 100 m."""
    rules = TownRules(parked_cars_per_100m=24.0)
    assert rules.parking_bays == 18
    with pytest.raises(SettingError, match=r"do not fit; between junctions there is room for 24.0"):
        TownRules(parked_cars_per_100m=24.1)


def test_streets_have_their_limits():
    rules = TownRules(main_every=3)
    assert [rules.main(street) for street in range(5)] == [True, False, False, True, False]
    assert rules.limit_mps(3) == rules.main_speed_mps > rules.limit_mps(4) == rules.speed_mps


def test_mixed_keys_are_those_of_splitmix64():
    """The first numbers of SplitMix64 from 0 (its reference implementation)."""
    step = 0x9E3779B97F4A7C15
    found = [mix(n * step % 2**64) for n in range(3)]
    assert found == [0xE220A8397B1DCDAF, 0x6E789E6AA1B965F4, 0x06C45D188009454F]


def test_no_two_objects_share_a_number():
    """Of two streets with the same number, too, and of the two streams of cyclists."""
    numbers = {
        object_number(northbound, street, stream, member)
        for northbound in (False, True)
        for street in range(3)
        for stream in range(8)
        for member in (0, 1, 2**31, 2**32 - 1)
    }
    assert len(numbers) == 2 * 3 * 8 * 4
