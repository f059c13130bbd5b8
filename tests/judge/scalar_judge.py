"""Judges what consumers hold one object after the other, at every instant anew: what
``judge.consumers`` must agree with.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from genie_sim.base.classes import class_of
from genie_sim.base.matching import near, pairs
from genie_sim.core.messages import Detection, Detections, Image, Location
from genie_sim.core.view import ViewSector
from genie_sim.judge.scenes import DriveTruth
from genie_sim.record.records import HeldObjectRow, HeldRow
from genie_sim.record.tables import Table
from genie_sim.tracks.consumer import Consumer, Newest, Shown
from genie_sim.tracks.track import COAST_NS, NEAR_M
from tests.judge.judging import is_there

S = 1_000_000_000


def held(shown: Sequence[Shown], now_ns: int) -> list[Detection]:
    """One list of what answers show, answer by answer."""
    objects: list[Detection] = []
    sectors: list[ViewSector] = []
    for part in shown:
        new = []
        for detection in part.objects:
            place = detection.location
            if place is None or any(it.distance_m(*place[:2]) is not None for it in sectors):
                continue
            if part.valid_ns is not None and detection.motion is not None:
                dt_s = min(max(now_ns - part.valid_ns, 0), COAST_NS) * 1e-9
                east_mps, north_mps = detection.motion.velocity_mps
                place = (place[0] + east_mps * dt_s, place[1] + north_mps * dt_s, place[2])
                detection = detection.with_location(place)
            if not any(_same(detection, other) for other in objects):
                new.append(detection)
        objects += new
        if part.valid_ns is not None and part.viewer is not None:
            sectors.append(ViewSector(part.viewer.pose, part.viewer.horizontal_fov_rad))
    return objects


def _same(ours: Detection, theirs: Detection) -> bool:
    assert ours.location is not None and theirs.location is not None
    return ours.label == theirs.label and math.dist(ours.location[:2], theirs.location[:2]) < NEAR_M


class ScalarJudge:
    """The interface of ``ConsumerJudge``; objects are few."""

    def __init__(
        self,
        method: str,
        truths: Mapping[str, DriveTruth],
        table: Table,
        earlier_cars: Sequence[str] = (),
        make_consumer: Callable[[], Consumer] = Newest,
        *,
        held_objects: Table,
        all_streams: bool = False,
    ) -> None:
        self.method, self.truths, self.table, self.objects = method, truths, table, held_objects
        self.earlier_cars, self.all_streams = earlier_cars, all_streams
        self.consumers = {car: make_consumer() for car in truths}
        self.first_streams: dict[str, str] = {}
        self.visible: list[tuple[int, str, float, float]] = []
        # by camera: since when each object is open
        self.open: dict[tuple[str, str], dict[tuple[Any, ...], int]] = {}

    def answered(self, answer: Detections, now_ns: int) -> None:
        if answer.header.origin in self.truths:
            self.consumers[answer.header.origin].on_answer(answer, now_ns)

    def published(self, image: Image) -> None:
        now_ns, stream, car = image.header
        if car not in self.truths:
            return
        self.consumers[car].on_frame(image)
        if self.first_streams.setdefault(car, stream) != stream and not self.all_streams:
            return
        truth = self.truths[car]
        real = [it for it in truth.visible(image.content) if _sees(image, it.location, truth)]
        objects = held(self.consumers[car].shown(now_ns), now_ns)
        self.judge("consumer", image, objects, real)
        if car not in self.earlier_cars:
            detections = [it for it in image.content.detections if it.location is not None]
            self.judge("zero_delay", image, detections, real)
        self.visible += [(now_ns, class_of(it.label), *it.location[:2]) for it in real]

    def judge(self, what: str, image: Image, objects: Sequence[Detection], real: Any) -> None:
        now_ns, stream, car = image.header
        truth = self.truths[car]
        ours: list[Any] = [
            it for it in objects if truth.knows(it.label) and _sees(image, it.location, truth)
        ]
        places, there = (
            [(class_of(it.label), *it.location[:2]) for it in side] for side in (ours, real)
        )
        candidates = near(places, there, truth.tolerance_m)
        matched = pairs(candidates, truth.tolerance_m)
        words = ["never_there"] * len(ours)
        for i, (label, east_m, north_m) in enumerate(places):
            if any(i == ours_i for _, ours_i, _ in matched):
                words[i] = "right"
            elif any(i == it[1] for it in candidates):
                words[i] = "duplicate"
            elif is_there(truth, image.content, label, east_m, north_m):
                words[i] = "hidden"
            elif any(
                (label, t_ns >= now_ns - 10 * S) == (other, True)
                and math.dist(place, (east_m, north_m)) <= truth.tolerance_m
                for t_ns, other, *place in self.visible
            ):
                words[i] = "moved_away"
        counted = [i for i, word in enumerate(words) if word != "hidden"]
        found = {j for _, _, j in matched}
        errors_m = [math.sqrt(d2) for d2, _, _ in matched]
        row = HeldRow(
            method=self.method,
            what=what,
            car=car,
            stream=stream,
            stamp_ns=now_ns,
            held=len(counted),
            right=len(matched),
            moved_away=words.count("moved_away"),
            never_there=words.count("never_there"),
            duplicate=words.count("duplicate"),
            hidden=words.count("hidden"),
            visible_static=sum(not it.moving for it in real),
            found_static=sum(not real[j].moving for j in found),
            visible_moving=sum(it.moving for it in real),
            found_moving=sum(real[j].moving for j in found),
            error_m=sum(errors_m) / len(errors_m) if errors_m else None,
        )
        self.table.append(row)
        if what == "consumer":
            missed = [(it, "missed") for j, it in enumerate(real) if j not in found]
            self.follow(image, [(ours[i], words[i]) for i in counted] + missed)

    def follow(self, image: Image, judged: Sequence[tuple[Any, str]]) -> None:
        now_ns, stream, car = image.header
        open_ns = self.open.setdefault((car, stream), {})
        keys = dict.fromkeys((it.label, *it.location[:2], word) for it, word in judged)
        for key in [key for key in open_ns if key not in keys]:
            self.end(car, stream, key, begin_ns=open_ns.pop(key), end_ns=now_ns)
        for key in keys:
            open_ns.setdefault(key, now_ns)

    def end(self, car: str, stream: str, key: Any, begin_ns: int, end_ns: int | None) -> None:
        self.objects.append(HeldObjectRow(self.method, car, stream, *key, begin_ns, end_ns))

    def close(self) -> None:
        for camera, open_ns in self.open.items():
            for key, begin_ns in open_ns.items():
                self.end(*camera, key, begin_ns=begin_ns, end_ns=None)


def _sees(image: Image, location: Location | None, truth: DriveTruth) -> bool:
    assert location is not None
    east_m, north_m = location[0] - image.pose.east_m, location[1] - image.pose.north_m
    turn_rad = math.remainder(math.atan2(north_m, east_m) - image.pose.heading_rad, math.tau)
    return (
        east_m**2 + north_m**2 <= truth.range_m**2 and abs(turn_rad) <= image.horizontal_fov_rad / 2
    )
