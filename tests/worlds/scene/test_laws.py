"""The laws of the town's detector, against the real detector that they were fitted on, and against
known ones.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from importlib import resources
from itertools import pairwise

import numpy as np
import pytest

from genie_sim.base import files
from genie_sim.base.units import NS_PER_S
from genie_sim.core.messages import CameraPose
from genie_sim.data.kitti.drive_truth import read_labels
from genie_sim.data.trace import read_trace
from genie_sim.worlds.scene.detector import SyntheticDetector
from genie_sim.worlds.scene.keys import VIEWS, mix
from genie_sim.worlds.scene.laws import (
    MAX_VIEW_M,
    MIDDLE,
    STEPS_PER_Z,
    FittedLaws,
    quantile,
    synthetic_laws,
)
from genie_sim.worlds.scene.noise import normals, smooth_normals, smooth_row
from genie_sim.worlds.scene.objects import HORIZONTAL_FOV_RAD, ObjectColumns
from genie_sim.worlds.scene.view import ViewPoses, VisibleObjects
from genie_sim.worlds.town import Town, TownRules
from genie_sim.worlds.town.rules import GHOSTS_PER_100M
from tools.make.town_fit import fit, validation

VEHICLES, PERSONS = ("car", "truck", "bus"), ("person",)
REPLICATIONS = 40


@pytest.fixture(scope="module")
def laws() -> FittedLaws:
    return synthetic_laws()


@pytest.fixture(scope="module")
def trace():
    return read_trace(files.find(files.TRACE, "kitti_0005"))


@pytest.fixture(scope="module")
def town_frames() -> list:
    """About 2,000 frames of 240 cars in six default towns (seeds 0 to 5)."""
    towns = [Town(TownRules(), seed) for seed in range(6)]
    drives = [town.drive(f"car{k}", 40 * NS_PER_S) for town in towns for k in range(40)]
    return [frame for drive in drives for frame in drive.frames["02"][::50]]


def _numbers(frames, labels: Sequence[str]) -> list[int]:
    return [sum(d.label in labels for d in frame.detections) for frame in frames]


def test_random_numbers_are_normal():
    """Of 20,000 keys in a row; the smooth numbers are alike as exp(-distance)."""
    table = normals()
    assert (np.diff(table) > 0).all()
    drawn = np.array([table[mix(key) & 0xFFF] for key in range(20_000)])
    assert abs(drawn.mean()) < 0.03
    assert drawn.std() == pytest.approx(1, abs=0.03)
    assert abs(np.corrcoef(drawn[1:], drawn[:-1])[0, 1]) < 0.03
    row = np.array(smooth_normals(0.05))
    assert len(row) == 1 << VIEWS.bits
    assert row.std() == pytest.approx(1, abs=0.05)
    for apart in (1, 10, 40):
        correlation = np.corrcoef(row[apart:], row[:-apart])[0, 1]
        assert correlation == pytest.approx(math.exp(-0.05 * apart), abs=0.05)
    rows = smooth_row(np.array([20.3, -0.6]), offset=np.array([60_000, 1]), direction=2)
    assert rows.tolist() == [60_000 + 81 + 2 * 16_411 - 65_536, 1 - 2 + 2 * 16_411]


def _known(miss: float, of_object: float, of_view: float) -> FittedLaws:
    """Laws that are easy to say: one miss probability everywhere, scores from 0.3 to 0.9, errors of
    up to 1 m.
    """
    correlation = {"object": of_object, "view": of_view, "smooth_m": 3.0}
    group = {
        "found": {
            "range_m": [20.0],
            "miss": [miss],
            "scores": [np.linspace(0.3, 0.9, 21).tolist()],
        },
        "place": {
            "range_m": [20.0],
            "along_m": [np.linspace(-1, 1, 21).tolist()],
            "across_m": [np.linspace(-0.5, 0.5, 21).tolist()],
        },
        **{f"{name}_correlation": correlation for name in ("score", "along", "across")},
    }
    ghost = {
        **group,
        "places": 0,
        "fleeting_a_frame": 0.0,
        "fleeting_range_m": [9, 9],
        "fleeting_scores": [1, 1],
    }
    groups = {"vehicles": group, "persons": group}
    ghosts = {"vehicles": ghost, "persons": ghost}
    names = {"prone": 0.0, "names": []}
    return FittedLaws(
        {"groups": groups, "ghosts": ghosts, "vehicle_names": names, "provenance": {}}
    )


def _drive_by(objects: int = 150) -> list[fit.Look]:
    """Looks at objects that stand 5 m beside a street, from 35 m to 10 m, two a metre."""
    looks = []
    for number in range(objects):
        for gone_m in np.arange(0.0, 25.0, 0.5):
            pose = CameraPose(gone_m, 0.0, 1.65, 0.0)
            range_m = math.hypot(36.0 - gone_m, 5.0)
            looks.append(
                fit.Look(
                    number,
                    "02",
                    pose,
                    (36.0, 5.0, 0.75),
                    range_m,
                    range_m - gone_m,
                    None,
                    None,
                    None,
                )
            )
    return looks


def test_known_laws_are_found_again():
    """150 objects, 50 looks each: what the town's detector does is what its laws say."""
    resimulated = validation.resimulate(_known(0.3, 0.3, 0.4), "vehicles", _drive_by(), seed=1)
    assert len(resimulated) == 7500
    assert validation.found_share(resimulated) == pytest.approx(0.7, abs=0.05)
    along, across = (validation.errors(resimulated, name) for name in ("along_m", "across_m"))
    assert validation.distance(validation.scores(resimulated), np.linspace(0.3, 0.9, 1000)) < 0.08
    assert validation.distance(along, np.linspace(-1, 1, 1000)) < 0.08
    assert validation.distance(across, np.linspace(-0.5, 0.5, 1000)) < 0.08


@pytest.mark.slow
def test_the_copula_is_fitted_from_looks_alone():
    """Planted: half of the variance with the object, 0.3 with the view; found within 0.15 from 150
    objects.
    """
    resimulated = validation.resimulate(_known(0.2, 0.5, 0.3), "vehicles", _drive_by(), seed=3)
    values = [0.0 if look.detection is None else look.detection.score for look in resimulated]
    found = fit.shares_of(resimulated, values, (0, 60), seed=1, replications=3)
    assert found["object"] == pytest.approx(0.5, abs=0.15)
    assert found["object"] + found["view"] == pytest.approx(0.8, abs=0.15)


def test_errors_along_and_across_are_drawn_apart():
    """Of looks with nothing lasting in them: no correlation between the two errors of a place, nor
    between an error and the score.
    """
    resimulated = validation.resimulate(_known(0.0, 0.0, 0.0), "vehicles", _drive_by(), seed=5)
    columns = [(look.along_m, look.across_m, look.detection.score) for look in resimulated]
    along_m, across_m, score = np.array(columns).T
    margin = 4 / math.sqrt(len(resimulated))
    for a, b in ((along_m, across_m), (along_m, score), (across_m, score)):
        assert abs(np.corrcoef(a, b)[0, 1]) < margin
    assert along_m.std() == pytest.approx(2 / math.sqrt(12), rel=0.1)
    assert across_m.std() == pytest.approx(1 / math.sqrt(12), rel=0.1)


def test_errors_do_not_jump_in_a_bend():
    """What changes with the view alone is the same all the way round a circle of 60 m, where a car
    stays 20 m ahead; on a grid of streets it would be another view at each turn.
    """
    laws, count = _known(0.0, 0.0, 1.0), 100
    objects = ObjectColumns(["car"], [1], [True], laws=laws, seed_key=0)
    angle_rad, none = np.linspace(0.0, math.tau, count), np.zeros(count, dtype=np.int64)
    cos, sin = np.cos(angle_rad), np.sin(angle_rad)
    poses = ViewPoses(
        60 * cos, 60 * sin, -sin, cos, t_s=none, key=np.arange(count, dtype=np.uint64)
    )
    ahead_m = 60 * np.array([np.cos(angle_rad + 1 / 3), np.sin(angle_rad + 1 / 3)])
    away_m = np.hypot(*(ahead_m - poses[:2]))
    visible = VisibleObjects(np.arange(count), none, none, *ahead_m, away_m=away_m)
    spreads_m = []
    for on_grid in (False, True):
        placed = SyntheticDetector(objects, laws, on_grid=on_grid).detect(visible, poses).placed
        spreads_m.append(np.ptp(np.hypot(*(placed[:, 1:3].T - ahead_m))))
    assert spreads_m[0] < 2e-3 and spreads_m[1] > 0.1


def test_fleeting_ghosts_are_anywhere_in_view(laws):
    """Of 10,000 keys: as many as the laws say, as many left of the camera's axis as right of it,
    evenly over the bearings, at the ranges of the law; and turned as the camera is.
    """
    nothing = ObjectColumns([], [], [], laws=laws, seed_key=0)
    detector = SyntheticDetector(nothing, laws, on_grid=True)
    law, heading_rad = laws.fleeting[1], 2.0
    here = 10.0, -20.0, math.cos(heading_rad), math.sin(heading_rad), 0.0
    frames = [mix(key) for key in range(10_000)]
    poses = ViewPoses(
        *(np.full(len(frames), number) for number in here), key=np.array(frames, dtype=np.uint64)
    )
    ghosts = [ghost for slot in range(len(frames)) for ghost in detector.fleeting(poses, slot)]
    assert len(ghosts) == pytest.approx(1e4 * sum(of.per_frame for of in laws.fleeting), rel=0.02)
    away_m = np.array([g.location[:2] for g in ghosts if g.label == law.label]) - here[:2]
    assert len(away_m) == pytest.approx(1e4 * law.per_frame, rel=0.03)
    bearings_rad = np.arctan2(away_m[:, 1], away_m[:, 0]) - heading_rad
    bearings_rad -= np.rint(bearings_rad / math.tau) * math.tau
    evenly = np.linspace(-HORIZONTAL_FOV_RAD / 2, HORIZONTAL_FOV_RAD / 2, 4000)
    assert validation.distance(bearings_rad, evenly) < 0.04
    assert np.max(np.abs(bearings_rad)) <= HORIZONTAL_FOV_RAD / 2 + 1e-3
    expected_m = [quantile(law.ranges_m, share) for share in (np.arange(4000) + 0.5) / 4000]
    assert validation.distance(np.hypot(*away_m.T), expected_m) < 0.04
    near = SyntheticDetector(nothing, laws, on_grid=True, view_m=20.0)
    assert [ghost for slot in range(len(frames)) for ghost in near.fleeting(poses, slot)] == [
        ghost for ghost in ghosts if math.dist(ghost.location[:2], here[:2]) <= 20.0
    ]


def test_other_laws_have_another_digest():
    """As what is made from them: it is computed from the laws, and no file says it."""
    assert _known(0.3, 0.3, 0.4).digest != _known(0.3, 0.3, 0.41).digest


def test_numbers_stay_within_the_tables(laws):
    """The largest and the least number that a look can have lie between -7 and 7, and its range,
    which is rounded to whole metres, within the rows.
    """
    assert laws.score.table.shape[1] > MAX_VIEW_M + 1
    for label, real in (("car", True), ("person", True), ("car", False)):
        number, largest = laws.group_of(label, real), max(map(abs, normals()))
        for copula in (laws.score, laws.along, laws.across):
            z = (copula.object_weight[number] + copula.look_weight[number]) * largest
            z += copula.view_weight[number] * np.abs(copula.views[number]).max()
            assert z * STEPS_PER_Z < MIDDLE


def test_some_vehicles_are_called_something_else_at_times(laws):
    """On drive 0005 two of the labelled vehicles: most are always cars, the others now and then a
    truck or a bus.
    """
    resimulated = validation.resimulate(laws, "vehicles", _drive_by(400), seed=4)
    names: dict[int, set[str]] = {}
    for look in resimulated:
        if look.detection is not None:
            names.setdefault(look.track, set()).add(look.detection.label)
    assert set().union(*names.values()) == {"car", "truck", "bus"}
    prone = sum(item != {"car"} for item in names.values()) / len(names)
    assert prone == pytest.approx(2 / 11, abs=0.07)


def test_the_laws_are_those_of_the_shipped_trace(laws, trace):
    """When the trace is made again, so must be the laws: python tools/make/town_laws.py."""
    assert laws.provenance["trace_digest"] == trace.digest
    assert "KITTI" in laws.provenance["data"]
    assert laws.provenance["detector"] == trace.provenance["detector"]


@pytest.mark.slow
def test_a_frame_of_the_town_shows_as_much_as_one_of_the_trace(trace, town_frames):
    """Detections a frame: means within a fifth; Kolmogorov-Smirnov distance of vehicles up to 0.2,
    of persons 0.3.

    The trace is one street with one cyclist ahead all the way; a town has more variety than that.
    """
    real_frames = [*trace.by_picture.values()]
    for labels, margin in ((VEHICLES, 0.2), (PERSONS, 0.3)):
        real, from_town = _numbers(real_frames, labels), _numbers(town_frames, labels)
        print(
            f"{labels[0]}: real {np.mean(real):.2f}, town {np.mean(from_town):.2f}, "
            f"{validation.distance(real, from_town):.3f}"
        )
        assert np.mean(from_town) == pytest.approx(np.mean(real), rel=0.2)
        assert validation.distance(real, from_town) < margin


@pytest.mark.slow
def test_vehicles_are_seen_from_as_far_and_as_surely_as_in_the_trace(trace, town_frames):
    """Of all detections of vehicles: Kolmogorov-Smirnov distance of ranges up to 0.12, of scores up
    to 0.2.
    """
    real_frames = [*trace.by_picture.values()]
    samples = []
    for frames in (real_frames, town_frames):
        found = [
            (f.pose, d)
            for f in frames
            for d in f.detections
            if d.label in VEHICLES and d.location is not None
        ]
        samples.append(
            (
                [math.dist(pose[:2], d.location[:2]) for pose, d in found],
                [d.score for _, d in found],
            )
        )
    ranges, scores = (validation.distance(samples[0][k], samples[1][k]) for k in (0, 1))
    print(f"ranges {ranges:.3f}, scores {scores:.3f}")
    assert ranges < 0.12
    assert scores < 0.2


def test_ghosts_come_back_at_their_places(laws):
    """A place where the real detector was wrong again and again is one in the town, where nothing
    really is.
    """
    town = Town(TownRules(blocks=(3, 3)), 1)
    ghosts = [item for street in town.streets for item in street.objects if not item.real]
    expected = sum(laws.ghosts_per_100m.values()) * 2 * 4 * 450 / 100  # of so many metres of street
    assert len(ghosts) == pytest.approx(expected, abs=4 * math.sqrt(expected))
    assert sum(laws.ghosts_per_100m.values()) == pytest.approx(GHOSTS_PER_100M, abs=0.05)
    assert not any(item.speed_mps for item in ghosts)
    assert (town.objects.group[~town.objects.real] == laws.group_of("car", real=False)).all()


@pytest.fixture(scope="module")
def looks(kitti_root, trace):
    """Every labelled object in every picture that counts: drive 0005, both cameras, by its own
    tracklets.
    """
    return fit.looks(trace, read_labels(kitti_root, "2011_09_26/0005", trace))


def _bins(group: str, rows: Sequence[fit.Look]):
    edges_m = fit.SCORE_EDGES_M[group]
    for low_m, high_m in pairwise(edges_m):
        here = [look for look in rows if low_m <= look.range_m < high_m]
        if here:
            yield (low_m, high_m), here


@pytest.mark.slow
@pytest.mark.parametrize(
    ("group", "margins"),
    [("vehicles", (0.03, 0.06, 0.08, 0.08)), ("persons", (0.05, 0.1, 0.15, 0.08))],
)
def test_the_town_detector_says_what_the_real_one_said(laws, looks, group, margins):
    """The same true objects from the same places: 40 replications (seeds 0 to 39) compared with the
    real trace.

    Margins: share found, in all and in each bin of ranges (0.05 more); Kolmogorov-Smirnov distances
    of the scores and of the errors along the line of sight and across. The data of persons are
    three tracks.
    """
    real = looks[group]
    from_town = [
        look
        for seed in range(REPLICATIONS)
        for look in validation.resimulate(laws, group, real, seed)
    ]
    assert len(from_town) > 0.9 * REPLICATIONS * len(real)
    gaps = [validation.found_share(from_town) - validation.found_share(real)]
    made_bins = dict(_bins(group, from_town))
    share = validation.found_share
    gaps += [share(made_bins[span]) - share(here) for span, here in _bins(group, real)]
    score = validation.distance(validation.scores(real), validation.scores(from_town))
    errors = [
        (validation.errors(real, name), validation.errors(from_town, name))
        for name in ("along_m", "across_m")
    ]
    along, across = (validation.distance(*pair) for pair in errors)
    print(
        f"{group}: gaps of found {np.round(gaps, 3)}, score {score:.3f}, "
        f"along {along:.3f}, across {across:.3f}"
    )
    assert abs(gaps[0]) < margins[0]
    assert max(map(abs, gaps)) < margins[0] + 0.05
    assert score < margins[1]
    assert along < margins[2]
    assert across < margins[3]


@pytest.mark.parametrize("group", ["vehicles", "persons"])
def test_the_town_detector_misses_in_runs_as_the_real_one(laws, looks, group):
    """How often found changes to missed from one picture to the next: the real share is within
    those of 40 replications, and less than half of what independent misses would give.
    """
    real = looks[group]
    from_town = [
        validation.changes(validation.resimulate(laws, group, real, seed))
        for seed in range(REPLICATIONS)
    ]
    independent = validation.independent_changes(group, real)
    print(
        f"{group}: real {validation.changes(real):.3f}, town {np.mean(from_town):.3f}, "
        f"independent {independent:.3f}"
    )
    assert min(from_town) <= validation.changes(real) <= max(from_town)
    assert np.mean(from_town) < 0.65 * independent
    assert np.mean(from_town) == pytest.approx(validation.changes(real), abs=0.05)


@pytest.mark.slow
@pytest.mark.nightly
def test_the_committed_laws_are_made_again_from_the_data(kitti_root, trace):
    """tools/make/town_laws.py: the same trace and labels give the numbers that are committed."""
    laws = fit.fit(
        trace,
        read_labels(kitti_root, "2011_09_26/0005", trace),
        read_labels(kitti_root, "tracking/0000", trace),
    )
    path = resources.files("genie_sim.worlds.scene") / "laws.json"
    committed = json.loads(path.read_text(encoding="utf-8"))
    for key in ("groups", "ghosts", "vehicle_names"):
        assert json.loads(json.dumps(laws[key])) == committed[key]
