"""The town: its streets and people, made from rules and a seed alone, and the drives of any cars through it."""

import functools
import hashlib
import json
import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import asdict
from operator import attrgetter
from typing import Any

import numpy as np

from genie_sim.core.geometry import Geodetic
from genie_sim.errors import UserError
from genie_sim.messages import CameraPose, Detection
from genie_sim.perception.trace import IMAGE_HEADER_BYTES, POSITION_DECIMALS
from genie_sim.seeds import stream
from genie_sim.town import routes
from genie_sim.town.detector import Found, SyntheticDetector, transient
from genie_sim.town.laws import DetectorLaws, detector_laws
from genie_sim.town.noise import mix
from genie_sim.town.objects import HEIGHT, HORIZONTAL_FOV_RAD, WIDTH, Things, TownObject
from genie_sim.town.rules import TownRules
from genie_sim.town.streets import Street, Streets, lay_out
from genie_sim.town.surrogate import LAWS, surrogates
from genie_sim.town.view import Eyes, Looks, View

ORIGIN: Geodetic = (
    49.0,
    8.4,
    115.0,
)  # near Karlsruhe, where KITTI was recorded; the town itself is made up
STREAM = "city"  # names the random streams, here and in digests: another word makes another town of every seed
CAMERA_UP_M = 1.65
TOGETHER = 16  # frames of a camera whose views are worked out at once
BASELINES_M = {"02": 0.27, "03": -0.27}  # to the left of the car's middle
_score = attrgetter("score")


class Town:
    """A town with everything that stands and moves in it.

    The same rules and seed give the same town; it is laid out at the first look. Its clock starts at 0; what moves is
    where it is at that time for every car that looks. ``digest`` is the sha256 of what decides it: rules, seed, laws.
    """

    name = "town"

    def __init__(self, rules: TownRules, seed: int) -> None:
        if seed < 0:
            raise UserError(f"town: seed: {seed} is negative")
        self.rules, self.seed = rules, seed
        self.laws: DetectorLaws = detector_laws()
        text = json.dumps([f"{STREAM} 1", asdict(rules), seed, self.laws.digest], sort_keys=True)
        self.digest = hashlib.sha256(text.encode()).hexdigest()
        self.key = int.from_bytes(hashlib.sha256(f"{STREAM} {seed}".encode()).digest()[:8], "big")
        self.size_m = (rules.blocks[0] * rules.block_m, rules.blocks[1] * rules.block_m)

    @functools.cached_property
    def streets(self) -> Streets:
        """Every street with what stands and moves on it."""
        columns, rows = self.rules.blocks

        def ways(name: str, blocks: int) -> list[Street]:
            streams = (stream(self.seed, STREAM, name, k) for k in range(blocks + 1))
            northbound = name == "north"
            return [
                lay_out(self.rules, self.laws, northbound, k, self.key, one)
                for k, one in enumerate(streams)
            ]

        return Streets(self.rules, ways("east", rows), ways("north", columns))

    @functools.cached_property
    def detector(self) -> SyntheticDetector:
        """The detector of every camera in the town."""
        return SyntheticDetector(self.things, self.laws)

    @functools.cached_property
    def things(self) -> Things:
        """All that stands and moves in the town, by number of the streets."""
        return Things(
            [one for street in (*self.streets.east, *self.streets.north) for one in street.things]
        )

    @functools.cached_property
    def eyes(self) -> Eyes:
        """What every camera in the town has in view."""
        return Eyes(self.streets, self.things, self.rules.view_m)

    @functools.cached_property
    def _commuting(self) -> routes.Commuting:
        return routes.Commuting(self.rules, stream(self.seed, STREAM, "destinations"))

    def drive(
        self, car: str, duration_ns: int, interval_ns: int = 100_000_000, start_ns: int = 0
    ) -> "Drive":
        """What the cameras of one car see, a frame every ``interval_ns``, from ``start_ns`` on the town's clock on.

        The route is the car's own: it depends on the town and the car's name alone. Raises UserError for times that
        leave no frame.
        """
        return Drive(self, car, duration_ns, interval_ns, start_ns)

    @property
    def provenance(self) -> Mapping[str, object]:
        """Where it comes from, for ``run.json``."""
        laws = {"laws": dict(self.laws.provenance), "laws_digest": self.laws.digest}
        features = dict.fromkeys(LAWS, "surrogate")
        return {
            "source": "town",
            "rules": asdict(self.rules),
            "seed": self.seed,
            **laws,
            "features": features,
        }

    def course(self, car: str, start_ns: int, end_ns: int) -> routes.Course:
        """Where a car is from ``start_ns`` to ``end_ns``."""
        random = stream(self.seed, STREAM, "car", car)
        return routes.drive(self.rules, self._commuting, random, start_ns * 1e-9, end_ns * 1e-9)

    def is_there(
        self, labels: Collection[str], east_m: float, north_m: float, range_m: float, t_ns: int
    ) -> bool:
        """Whether anything of these classes really is within a distance of a place at a time."""
        return any(s.real for s in self.streets.near(east_m, north_m, range_m, t_ns * 1e-9, labels))


class Drive:
    """What the cameras of one car see in a town: has the frames of a ``Trace``.

    ``origin`` is latitude [deg], longitude [deg], altitude [m]. ``frames`` are made when they are looked at.
    """

    def __init__(
        self, town: Town, car: str, duration_ns: int, interval_ns: int, start_ns: int
    ) -> None:
        if interval_ns <= 0 or duration_ns <= 0 or start_ns < 0:
            raise UserError(
                f"town: drive of {car}: duration {duration_ns} ns and interval {interval_ns} ns must be positive, "
                f"start {start_ns} ns not negative"
            )
        self.town, self.car, self.duration_ns = town, car, duration_ns
        self.interval_ns, self.start_ns = interval_ns, start_ns
        self.name = f"town_{car}"
        self.origin: Geodetic = ORIGIN
        text = json.dumps([town.digest, car, start_ns, interval_ns])
        self.picture_prefix = hashlib.sha256(text.encode()).hexdigest()[:48]
        self.car_key = int(self.picture_prefix[:16], 16)
        count = math.ceil(duration_ns / interval_ns)
        self.frames: Mapping[str, Sequence[TownFrame]] = {
            name: TownFrames(self, name, count) for name in BASELINES_M
        }

    @functools.cached_property
    def course(self) -> routes.Course:
        """Where the car is, at any time of the drive."""
        return self.town.course(self.car, self.start_ns, self.start_ns + self.duration_ns)

    def position(self, t_ns: int) -> tuple[float, float]:
        """East and north of the car [m], ``t_ns`` after the drive's first frame."""
        east_m, north_m, *_ = self.course.at((self.start_ns + t_ns) * 1e-9)
        return east_m, north_m


class Glances:
    """Some frames of one camera, a few seconds at most: their poses, and what is in view and found, worked out for all
    of them when it is first asked for."""

    def __init__(self, drive: Drive, camera: str, indices: Sequence[int]) -> None:
        self.drive, self.camera = drive, camera
        self.keys = [mix(drive.car_key ^ (index << 8) ^ int(camera)) for index in indices]
        self.poses: list[CameraPose] = []
        at = []
        left_m = BASELINES_M[camera]
        for index in indices:
            t_s = (drive.start_ns + index * drive.interval_ns) * 1e-9
            east_m, north_m, heading, c, s, _ = drive.course.at(t_s)
            east_m = round(east_m - left_m * s, POSITION_DECIMALS)
            north_m = round(north_m + left_m * c, POSITION_DECIMALS)
            self.poses.append(
                CameraPose(
                    east_m, north_m, CAMERA_UP_M, round(math.remainder(heading, math.tau), 6)
                )
            )
            at.append((east_m, north_m, c, s, t_s))
        x, y, cos, sin, times_s = np.array(at).T
        self._looks = Looks(x, y, cos, sin, times_s, np.array(self.keys, dtype=np.uint64))

    @functools.cached_property
    def _view(self) -> View:
        return self.drive.town.eyes.view(self._looks)

    @functools.cached_property
    def _found(self) -> Found:
        found = self.drive.town.detector.detect(self._view, self._looks)
        del self._view  # mostly nobody asks for the truth
        return found

    def detections(self, place: int) -> tuple[Detection, ...]:
        """What the detector finds in one of the frames, best score first."""
        found, key, looks = self._found.of(place), self.keys[place], self._looks
        draw = (key >> 48) / 0x10000
        for law in self.drive.town.laws.transient:
            if 0.0 <= draw < law.per_frame:
                c, s = looks.cos.item(place), looks.sin.item(place)
                found.append(transient(law, mix(key), self.poses[place], c, s))
            draw -= law.per_frame
        found.sort(key=_score, reverse=True)
        return tuple(found)

    def truth(self, place: int) -> tuple[TownObject, ...]:
        """What is really in view in one of the frames."""
        view, objects = self._view, self.drive.town.things.objects
        rows = slice(*np.searchsorted(view.look, (place, place + 1)))
        columns = (
            column[rows].tolist() for column in (view.thing, view.less, view.east_m, view.north_m)
        )
        seen = ((objects[thing], *rest) for thing, *rest in zip(*columns, strict=True))
        return tuple(one.at(one.number - less, x, y) for one, less, x, y in seen if one.real)


class TownFrame:
    """One camera frame of the town: has what a ``TraceFrame`` has, except that boxes are ``None``.

    ``digest`` names the town, the car, the camera and the frame: no two frames are byte for byte the same picture.
    ``dhash`` are bits of their own for each frame, so that pictures are never similar by it, however near their poses.
    ``detections`` are made when they are first asked for, from the town's seed, the car and the frame alone.
    """

    __slots__ = (
        "_detections",
        "_looks",
        "_place",
        "camera",
        "dhash",
        "digest",
        "index",
        "pose",
        "stamp_ns",
    )

    width = WIDTH
    height = HEIGHT
    size_bytes = WIDTH * HEIGHT * 3 + IMAGE_HEADER_BYTES
    horizontal_fov_rad = HORIZONTAL_FOV_RAD

    def __init__(self, looks: Glances, place: int, index: int) -> None:
        drive = looks.drive
        self._looks, self._place = looks, place
        self.camera, self.index = looks.camera, index
        self.stamp_ns = index * drive.interval_ns
        self.dhash, self.pose = looks.keys[place], looks.poses[place]
        self.digest = f"{drive.picture_prefix}{self.camera}{index:014x}"
        self._detections: tuple[Detection, ...] | None = None

    @property
    def detections(self) -> tuple[Detection, ...]:
        """What the detector finds in this frame, best score first."""
        if self._detections is None:
            self._detections = self._looks.detections(self._place)
        return self._detections

    def truth(self) -> tuple[TownObject, ...]:
        """What is really in view: in the field of view, not hidden by houses, within ``TownRules.view_m``, and at least
        25 pixels high in the picture, as KITTI's labels that count."""
        return self._looks.truth(self._place)

    @property
    def features(self) -> dict[str, bytes]:
        """Surrogates, by name: the town has no pictures."""
        seed = self._looks.drive.town.seed
        return {name: one.at(self.pose, self.dhash) for name, one in surrogates(seed).items()}

    def __eq__(self, other: object) -> bool:
        return isinstance(other, TownFrame) and self.digest == other.digest

    def __hash__(self) -> int:
        return hash(self.digest)

    def __repr__(self) -> str:
        return f"<TownFrame {self._looks.drive.name} {self.camera} {self.index}>"


class TownFrames(Sequence[TownFrame]):
    """All frames of one camera of a drive; made anew each time they are asked for."""

    __slots__ = ("_camera", "_count", "_drive")

    def __init__(self, drive: Drive, camera: str, count: int) -> None:
        self._drive, self._camera, self._count = drive, camera, count

    def __len__(self) -> int:
        return self._count

    def __iter__(self) -> Iterator[TownFrame]:
        return self._made(range(self._count))

    def __getitem__(self, index: Any) -> Any:
        chosen = range(self._count)[index]
        return (
            tuple(self._made(chosen)) if isinstance(chosen, range) else next(self._made((chosen,)))
        )

    def _made(self, indices: Sequence[int]) -> Iterator[TownFrame]:
        for begin in range(0, len(indices), TOGETHER):
            together = indices[begin : begin + TOGETHER]
            looks = Glances(self._drive, self._camera, together)
            yield from (TownFrame(looks, place, index) for place, index in enumerate(together))
