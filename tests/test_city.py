"""A generated town: the same for the same rules and seed, whoever asks for what in which order."""

from __future__ import annotations

import pickle

import pytest

from genie_sim.errors import UserError
from genie_sim.perception.city import Drive, Town, TownRules
from genie_sim.units import NS_PER_S

RULES = TownRules(blocks=(4, 4))
DURATION_NS = 20 * NS_PER_S


@pytest.fixture(scope="module")
def town() -> Town:
    return Town(RULES, seed=7)


def content(drive: Drive) -> list:
    return [(f.digest, f.dhash, f.pose, f.detections, f.truth()) for frames in drive.frames.values() for f in frames]


def test_the_same_rules_and_seed_give_the_same_drive(town):
    again = Town(RULES, seed=7).drive("car1", DURATION_NS)
    assert content(again) == content(town.drive("car1", DURATION_NS))
    assert again.digest == town.drive("car1", DURATION_NS).digest
    assert Town(RULES, seed=8).drive("car1", DURATION_NS).digest != again.digest


def test_frames_do_not_depend_on_the_order_in_which_they_are_asked_for(town):
    forwards = content(town.drive("car1", DURATION_NS))
    drive = town.drive("car1", DURATION_NS)
    backwards = [drive.frames[camera][i] for camera in ("03", "02") for i in reversed(range(len(drive.frames[camera])))]
    assert [(f.digest, f.dhash, f.pose, f.detections, f.truth()) for f in backwards][::-1] == forwards


def test_a_drive_travels_to_another_process(town):
    drive = town.drive("car1", DURATION_NS)
    packed = pickle.dumps(drive)
    assert len(packed) < 1000
    assert content(pickle.loads(packed)) == content(drive)


def test_no_two_pictures_are_the_same(town):
    frames = [f for car in ("a", "b") for frames in town.drive(car, DURATION_NS).frames.values() for f in frames]
    assert len({f.digest for f in frames}) == len({f.dhash for f in frames}) == len(frames) == 800
    assert all(len(f.digest) == 64 and int(f.digest, 16) and 0 <= f.dhash < 2**64 for f in frames)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"blocks": (0, 4)}, "town: blocks: "),
        ({"block_m": 40.0}, "town: block_m: 40.0 is too short to stop in"),
        ({"popularity": -1.0}, "town: popularity: -1.0 is negative"),
        ({"destinations": 0}, "town: destinations: 0 is not a whole number from 1 on"),
        ({"view_m": float("nan")}, "town: view_m: nan is not a finite number"),
        ({"street_half_m": 3.0}, "town: street_half_m: 3.0 is not between 8"),
        ({"truck_share": 1.5}, "town: truck_share: 1.5 is not between 0 and 1"),
    ],
)
def test_rules_that_make_no_town_are_refused(settings, message):
    with pytest.raises(UserError, match=message):
        TownRules(**settings)
