"""What every frame source has to keep. One of your own is tested by

@pytest.mark.parametrize("source", [{"source": "my_module:MySource", "seconds": 3.0}])
class TestMine(FrameSourceConformance):
    cameras = [{"name": "front", "recording": "front"}]
"""

from __future__ import annotations

import json
from typing import Any, ClassVar

from genie_sim.runs.prepare import prepare
from genie_sim.runs.simulate import simulate
from genie_sim.scenario.scenario import FRAME_SOURCE, Scenario
from tests.conformance import small


class FrameSourceConformance:
    """A source, as a scenario writes it under ``perception``. ``route`` is that of both cars."""

    cameras: ClassVar[list[dict[str, Any]]] = small.CAMERAS
    route: ClassVar[dict[str, Any]] = {}

    def scenario(self, source: dict[str, Any], **more: Any) -> Scenario:
        """``more``: further settings of the scenario, as in YAML."""
        cars = [small.car(i, route=self.route) for i in (1, 2)]
        return small.scenario(perception=source, cameras=self.cameras, cars=cars, **more)

    def test_its_frames_are_in_order_and_complete(self, source: dict[str, Any]):
        prepared = prepare(self.scenario(source))
        for drive in prepared.drives.values():
            assert drive.name and drive.frames
            for frames in drive.frames.values():
                stamps = [frame.stamp_ns for frame in frames]
                assert stamps and stamps[0] >= 0 and stamps == sorted(set(stamps))
                for frame in (frames[0], frames[-1]):
                    assert frame.size_bytes > 0 and 0 <= frame.dhash < 2**64 and frame.digest
                    assert frame.horizontal_fov_rad > 0 and len(frame.pose) == 4
                    assert all(0 <= one.score <= 1 for one in frame.detections)

    def test_it_is_the_same_whenever_it_is_opened(self, source: dict[str, Any]):
        one, other = (prepare(self.scenario(source, methods=["remote"])) for _ in range(2))
        assert dict(one.frames.digests()) == dict(other.frames.digests())
        small.same(*(small.rows(simulate(prepared)) for prepared in (one, other)))

    def test_no_state_goes_from_one_method_to_the_next(self, source: dict[str, Any]):
        small.check_order_is_irrelevant(lambda methods: self.scenario(source, methods=methods))

    def test_it_says_whether_a_seed_matters(self, source: dict[str, Any]):
        one, other = (prepare(self.scenario(source, seed=seed)).frames for seed in (1, 2))
        assert (dict(one.digests()) != dict(other.digests())) == one.seeded
        if one.seeded:
            scenario = self.scenario(source, seed=1)
            opened = FRAME_SOURCE.make(scenario.perception).open(1, scenario.origin)
            assert opened.digests() == one.digests(), "runs are planned by them"

    def test_where_its_frames_come_from_can_be_written_down(self, source: dict[str, Any]):
        frames = prepare(self.scenario(source)).frames
        assert frames.digests() and all(isinstance(one, str) for one in frames.digests().values())
        json.dumps({name: dict(known) for name, known in frames.provenance().items()})

    def test_every_frame_that_a_camera_takes_is_published_once(self, source: dict[str, Any]):
        prepared = prepare(self.scenario(source, methods=["local"]))
        found = simulate(prepared)["frames"].to_frame()
        for car, drive in prepared.drives.items():
            begin_ns, end_ns = prepared.scenario.cars[0].route.window_ns or (0, 10**15)
            for camera in self.cameras:
                stamps = [one.stamp_ns for one in drive.frames[camera["recording"]]]
                taken = sum(begin_ns <= stamp_ns < end_ns for stamp_ns in stamps)
                mine = found[(found["car"] == car) & (found["stream"] == camera["name"])]
                assert len(mine) == taken
