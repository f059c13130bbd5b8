"""When are two pictures the same: the bytes, the spot and the heading, or nearly the same grey
values.
"""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from genie_sim.base.setting_errors import SettingError
from genie_sim.core.similarity import SIMILARITIES, DHash, Exact, PoseGrid
from tests.core.conformance import SimilarityConformance
from tests.make import frame


class TestExact(SimilarityConformance):
    make = Exact


class TestPoseGrid(SimilarityConformance):
    make = PoseGrid


class TestDHash(SimilarityConformance):
    make = DHash


def test_every_similarity_is_held_to_the_conformance_tests():
    assert set(SIMILARITIES.values()) <= {
        one.make for one in SimilarityConformance.__subclasses__()
    }


def same(similarity, one, other):
    index = similarity.index()
    index.add(similarity.key(one))
    return index.find(similarity.key(other)) is not None


# exact


def test_one_changed_byte_makes_another_picture():
    picture = frame(0)
    assert not same(Exact(), picture, replace(picture, digest=picture.digest + "x"))


# pose_grid


def at(east_m=0.5, north_m=0.5, heading_deg=0.0, camera="02"):
    return frame(0, at=(east_m, north_m), heading_deg=heading_deg, camera=camera)


@pytest.mark.parametrize(
    "other", [at(0.0, 0.99), at(heading_deg=7), at(heading_deg=-7), at(heading_deg=360)]
)
def test_the_same_spot(other):
    assert same(PoseGrid(cell_m=1.0, heading_rad=math.radians(15)), at(), other)


@pytest.mark.parametrize(
    "other",
    [
        at(1.0),
        at(-0.1),
        at(north_m=1.2),
        at(north_m=-0.1),
        at(heading_deg=8),
        at(heading_deg=180),
        at(camera="03"),
    ],
)
def test_another_spot_heading_or_camera(other):
    assert not same(PoseGrid(cell_m=1.0, heading_rad=math.radians(15)), at(), other)


def test_a_larger_cell_takes_more_for_the_same_spot():
    assert not same(PoseGrid(cell_m=1.0), at(0.5), at(1.5))
    assert same(PoseGrid(cell_m=2.0), at(0.5), at(1.5))


@given(st.floats(-4 * math.pi, 4 * math.pi), st.integers(-2, 2))
@example(math.pi, -1)
def test_a_full_turn_is_the_same_heading(heading_rad, turns):
    """But for a billionth of a radian, where a sector begins."""
    grid, sector_rad = PoseGrid(), math.radians(15)
    into_sector_rad = (heading_rad + sector_rad / 2) % sector_rad
    if 1e-9 < into_sector_rad < sector_rad - 1e-9:
        one, other = (
            replace(at(), pose=at().pose._replace(heading_rad=rad))
            for rad in (heading_rad, heading_rad + turns * math.tau)
        )
        assert grid.key(one) == grid.key(other)


def test_headings_fall_into_equal_sectors():
    grid = PoseGrid(heading_rad=math.radians(100))  # the nearest whole number of sectors is 4
    assert len({grid.key(at(heading_deg=heading)) for heading in range(360)}) == 4


@pytest.mark.parametrize("wrong", [{"cell_m": 0.0}, {"heading_rad": 0.0}, {"cell_m": -1.0}])
def test_a_grid_needs_room(wrong):
    with pytest.raises(SettingError, match="more than zero"):
        PoseGrid(**wrong)


# dhash


def flipped(bits, value=0x0F0F_0F0F_0F0F_0F0F):
    return value ^ ((1 << bits) - 1)


@pytest.mark.parametrize(("bits", "equal"), [(0, True), (8, True), (9, False), (64, False)])
def test_hashes_may_differ_in_the_radius(bits, equal):
    one, other = replace(frame(0), dhash=flipped(0)), replace(frame(0), dhash=flipped(bits))
    assert same(DHash(radius=8), one, other) is equal


@settings(max_examples=10)
@given(
    st.lists(
        st.tuples(st.sampled_from([True, True, False]), st.integers(0, 2**10 - 1)),
        min_size=100,
        max_size=150,
    ),
    st.integers(0, 2**10 - 1),
    st.integers(0, 4),
)
def test_the_nearest_held_hash_is_found(changes, searched, radius):
    """Against a list: the nearest, and of equally near ones the one held for longest."""
    index, held = DHash(radius).index(), []
    for added, key in changes:
        if added:
            index.add(key)
            held += [key] if key not in held else []
        else:
            index.discard(key)
            held = [one for one in held if one != key]
    near = [key for key in held if (key ^ searched).bit_count() <= radius]
    expected = min(near, key=lambda key: (key ^ searched).bit_count()) if near else None
    assert index.find(searched) == expected


def test_of_equally_near_hashes_the_one_held_for_longest_is_found():
    index = DHash(radius=1).index()
    for bit in (*range(64), 0):  # the first is seen again at the end
        index.add(1 << bit)
    assert index.find(0) == 1 << 0
    index.discard(1 << 0)
    assert index.find(0) == 1 << 1


@pytest.mark.parametrize("radius", [-1, 65])
def test_a_radius_is_a_number_of_bits(radius):
    with pytest.raises(SettingError, match="from 0 to 64"):
        DHash(radius)
