"""What every scene has to keep, whatever its world. One of your own is tested by

class TestMine(SceneConformance):
    world = {"source": "my_module:MySource"}
    near_sighted = {"view": "20 m"}
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable
from typing import Any, ClassVar

import numpy as np
import pytest

from genie_sim.base import files
from genie_sim.base.units import NS_PER_S
from genie_sim.data.trace import TraceFrame, read_trace
from genie_sim.scenario.scenario import FRAME_SOURCE
from genie_sim.worlds.scene.frames import SceneFrame
from genie_sim.worlds.scene.objects import HORIZONTAL_FOV_RAD
from genie_sim.worlds.scene.source import SceneDrives
from genie_sim.worlds.scene.view import NEAREST_M
from tests.conformance import small

RANGE_M = 50.0
USUAL = {"duration": "3 s", "interval": "100 ms", "tolerance": "2 m", "range": "50 m"}
HALF_A_SECOND_NS = NS_PER_S // 2
Looks = list[tuple[Any, ...]]


def looks(frames: Iterable[SceneFrame]) -> Looks:
    """Everything that some frames show."""
    return [(f.digest, f.dhash, f.pose, f.stamp_ns, f.detections, f.truth()) for f in frames]


def detections(frames: Iterable[SceneFrame]) -> dict[Any, Any]:
    """What is detected, by the key of each frame."""
    return {frame.dhash: frame.detections for frame in frames}


class SceneConformance:
    """A source of scenes, as a scenario writes it under ``perception``: two of its cars see
    something, the second from half a second on. ``near_sighted``: a detector looks 20 m far.
    """

    world: ClassVar[dict[str, Any]]
    near_sighted: ClassVar[dict[str, Any]]
    cars: ClassVar[tuple[str, str]] = ("car1", "car2")

    @classmethod
    def open(cls, seed: int = 1, **settings: Any) -> SceneDrives:
        scenario = small.scenario(perception=USUAL | cls.world | settings)
        return FRAME_SOURCE.make(scenario.perception).open(seed, None)

    def frames(self, drives: SceneDrives) -> list[SceneFrame]:
        """All of both cars."""
        starts_ns = zip(self.cars, (0, HALF_A_SECOND_NS), strict=True)
        of_cars = [drives.drive(car, None, start_ns) for car, start_ns in starts_ns]
        return [frame for drive in of_cars for frames in drive.frames.values() for frame in frames]

    @pytest.fixture(scope="class")
    @classmethod
    def drives(cls) -> SceneDrives:
        return cls.open()

    def test_seed_and_settings_decide_what_is_seen_whoever_looks_first(self, drives: SceneDrives):
        again, other = self.open(), self.open(seed=2)
        looks([*again.drive(self.cars[1], None, HALF_A_SECOND_NS).frames["03"]][::-1])
        assert looks(self.frames(again)) == looks(self.frames(drives))
        assert looks(self.frames(other)) != looks(self.frames(drives))
        assert again.digests() == drives.digests() != other.digests()

    def test_a_frame_alone_is_that_of_its_batch(self, drives: SceneDrives):
        for car in self.cars:
            for frames in drives.drive(car, None, HALF_A_SECOND_NS).frames.values():
                alone = [frames[number] for number in reversed(range(len(frames)))]
                assert looks(alone)[::-1] == looks(frames)
                assert alone[0].detections is alone[0].detections, "made once"
                with pytest.raises(IndexError):
                    frames[len(frames)]

    def test_every_frame_is_a_picture_of_its_own_by_kitti_s_cameras(self, drives: SceneDrives):
        """It tells what the frame of a trace tells."""
        frames = self.frames(drives)
        real = read_trace(files.find(files.TRACE, "kitti_0005")).frames["02"][0]
        assert len({f.digest for f in frames}) == len({f.dhash for f in frames}) == len(frames)
        for field in dataclasses.fields(TraceFrame):
            kind = type(getattr(real, field.name))
            assert all(type(getattr(frame, field.name)) is kind for frame in frames), field.name
        for name in ("width", "height", "size_bytes", "horizontal_fov_rad"):
            assert getattr(frames[0], name) == getattr(real, name)
        for frame in frames:
            scores = [detection.score for detection in frame.detections]
            assert scores == sorted(scores, reverse=True)

    def test_cameras_stand_beside_each_other_and_look_where_the_car_goes(self, drives: SceneDrives):
        for car in self.cars:
            drive = drives.drive(car, None, HALF_A_SECOND_NS)
            before = None
            for left, right in zip(drive.frames["02"], drive.frames["03"], strict=True):
                heading_rad = left.pose.heading_rad
                ahead = np.array([math.cos(heading_rad), math.sin(heading_rad)])
                apart_m = np.subtract(left.pose[:2], right.pose[:2])
                assert right.pose.heading_rad == heading_rad
                assert apart_m == pytest.approx((-0.54 * ahead[1], 0.54 * ahead[0]), abs=2e-3)
                place = np.array(drive.position(left.stamp_ns))
                assert np.add(left.pose[:2], right.pose[:2]) / 2 == pytest.approx(place, abs=2e-3)
                if before is not None and math.dist(before, place) > 0.2:
                    assert (place - before) @ ahead > 0.98 * math.dist(before, place)
                before = place

    def test_on_a_grid_who_does_not_turn_drives_along_an_axis(self, drives: SceneDrives):
        """The detector's smooth numbers rest on it."""
        if drives.scene.on_grid:
            headings_rad = np.array([frame.pose.heading_rad for frame in self.frames(drives)])
            is_straight = np.diff(headings_rad) == 0
            assert np.abs(np.sin(2 * headings_rad[1:][is_straight])).max() < 1e-4

    @pytest.mark.parametrize(
        "ruler",
        [{"tolerance": "3 m", "range": "80 m"}, {"duration": "2 s"}, {"interval": "200 ms"}],
    )
    def test_who_judges_how_often_and_how_long_changes_no_detection(
        self, drives: SceneDrives, ruler: dict[str, Any]
    ):
        usual = detections(self.frames(drives))
        other = detections(self.frames(self.open(**ruler)))
        assert any(other.values()) and other == {look: usual[look] for look in other}

    def test_a_detector_that_looks_less_far_misses_what_is_beyond(self, drives: SceneDrives):
        """And all that it could see up to ``range`` stays there to be judged."""
        far, near = self.frames(drives), self.frames(self.open(**self.near_sighted))
        unjudged = self.frames(self.open(**self.near_sighted, range="1 m"))
        assert detections(near) == detections(unjudged) != detections(far)
        for usual, frame in zip(far, near, strict=True):
            assert {*frame.detections} <= {*usual.detections}
            away_m = [math.dist(frame.pose[:2], item.location[:2]) for item in usual.truth()]
            judged = zip(usual.truth(), away_m, strict=True)
            assert frame.truth() == tuple(item for item, m in judged if m <= RANGE_M)

    def test_what_is_in_view_is_there(self, drives: SceneDrives):
        """In the field of view of any car, when its frame is taken, by one truth for all."""
        truth = drives.truth_of(drives.drive(self.cars[0], None, 0))
        assert drives.truth_of(drives.drive(self.cars[1], None, HALF_A_SECOND_NS)) is truth
        frames, items = zip(
            *((f, item) for f in self.frames(drives) for item in f.truth()), strict=True
        )
        labels = [item.label for item in items]
        east_m, north_m, _ = np.array([item.location for item in items]).T
        assert all(map(truth.knows, labels))
        assert truth.are_there(frames, labels, east_m, north_m).all()
        assert not truth.are_there(frames, labels, east_m, north_m + 1e5).any()
        for frame, item in zip(frames, items, strict=True):
            way_m = np.subtract(item.location[:2], frame.pose[:2])
            off_rad = math.atan2(way_m[1], way_m[0]) - frame.pose.heading_rad
            assert abs(math.remainder(off_rad, math.tau)) <= HORIZONTAL_FOV_RAD / 2 + 1e-3
            assert NEAREST_M <= math.hypot(*way_m) <= drives.scene.sight_m

    def test_a_ghost_is_no_truth(self, drives: SceneDrives):
        """Of elephants nobody knows any: they are nothing, as what is seen where nothing is."""
        scene, truth = drives.scene, drives.truth_of(None)
        nothing = np.array([scene.objects.nothing])
        for frame in self.frames(drives)[::7]:
            at = (np.array([value]) for value in (*frame.pose[:2], frame.scene_ns * 1e-9))
            near = scene.visibility.near(*at, class_=nothing, radius_m=RANGE_M)
            asked = [frame] * len(near.row), ["elephant"] * len(near.row)
            assert not truth.are_there(*asked, near.east_m, near.north_m).any()
