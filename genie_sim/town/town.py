"""The town: its streets and people, made from rules and a seed alone, and the drives of any cars through it."""

from __future__ import annotations

import functools
import hashlib
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict

from genie_sim.core.geometry import Geodetic
from genie_sim.errors import UserError
from genie_sim.seeds import stream
from genie_sim.town import routes
from genie_sim.town.camera import BASELINES_M, Eye, TownFrame, TownFrames
from genie_sim.town.laws import DetectorLaws, detector_laws
from genie_sim.town.rules import TownRules, TrueObject
from genie_sim.town.streets import Street, Streets, lay_out

STREAMS = "city"  # the name of a town's random streams: another one would make other towns
ORIGIN: Geodetic = (49.0, 8.4, 115.0)  # near Karlsruhe, where KITTI was recorded; the town itself is made up


class Town:
    """A town with everything that stands and moves in it.

    The same rules and seed give the same town; it is laid out when somebody looks. Its clock starts at 0; what moves is
    where it is at that time for every car that looks. ``digest`` is the sha256 of what decides it: rules, seed, laws.
    """

    name = "town"

    def __init__(self, rules: TownRules, seed: int) -> None:
        if seed < 0:
            raise UserError(f"town: seed: {seed} is negative")
        self.rules, self.seed = rules, seed
        self.laws: DetectorLaws = detector_laws()
        text = json.dumps(["city 1", asdict(rules), seed, self.laws.digest], sort_keys=True)
        self.digest = hashlib.sha256(text.encode()).hexdigest()
        self.key = int.from_bytes(hashlib.sha256(f"city {seed}".encode()).digest()[:8], "big")
        self.size_m = (rules.blocks[0] * rules.block_m, rules.blocks[1] * rules.block_m)

    @functools.cached_property
    def streets(self) -> Streets:
        """Every street with what stands and moves on it."""
        columns, rows = self.rules.blocks

        def ways(name: str, blocks: int) -> list[Street]:
            streams = (stream(self.seed, STREAMS, name, k) for k in range(blocks + 1))
            northbound = name == "north"
            return [lay_out(self.rules, self.laws, northbound, k, self.key, one) for k, one in enumerate(streams)]

        return Streets(self.rules, ways("east", rows), ways("north", columns))

    @functools.cached_property
    def eye(self) -> Eye:
        """Whatever looks at it."""
        return Eye(self.streets, self.laws, self.rules.view_m)

    @functools.cached_property
    def _commuting(self) -> routes.Commuting:
        return routes.Commuting(self.rules, stream(self.seed, STREAMS, "destinations"))

    def drive(self, car: str, duration_ns: int, interval_ns: int = 100_000_000, start_ns: int = 0) -> Drive:
        """What the cameras of one car see, a frame every ``interval_ns``, from ``start_ns`` on the town's clock on.

        The route is the car's own: it depends on the town and the car's name alone. Raises UserError for times that
        leave no frame.
        """
        return Drive(self, car, duration_ns, interval_ns, start_ns)

    @property
    def provenance(self) -> Mapping[str, object]:
        """Where it comes from, for ``run.json``."""
        laws = {"laws": dict(self.laws.provenance), "laws_digest": self.laws.digest}
        return {"source": "town", "rules": asdict(self.rules), "seed": self.seed, **laws}

    def course(self, car: str, start_ns: int, end_ns: int) -> routes.Course:
        """Where a car is from ``start_ns`` to ``end_ns``."""
        random = stream(self.seed, STREAMS, "car", car)
        return routes.drive(self.rules, self._commuting, random, start_ns * 1e-9, end_ns * 1e-9)

    def truth_near(self, east_m: float, north_m: float, range_m: float, t_ns: int) -> tuple[TrueObject, ...]:
        """Everything that really is within a distance of a place at a time, by number."""
        found = (s for s in self.streets.near(east_m, north_m, range_m, t_ns * 1e-9) if s.real)
        objects = (TrueObject(s.number, s.label, (s.east_m, s.north_m, s.up_m), s.moving) for s in found)
        return tuple(sorted(objects, key=lambda one: one.number))

    def is_there(self, label: str, east_m: float, north_m: float, range_m: float, t_ns: int) -> bool:
        """Whether anything of a class really is within a distance of a place at a time."""
        return any(s.real for s in self.streets.near(east_m, north_m, range_m, t_ns * 1e-9, label))


class Drive:
    """What the cameras of one car see in a town; stands in for a ``Trace``.

    ``origin`` is latitude [deg], longitude [deg], altitude [m]. ``frames`` are made when they are looked at.
    """

    def __init__(self, town: Town, car: str, duration_ns: int, interval_ns: int, start_ns: int) -> None:
        if interval_ns <= 0 or duration_ns <= 0 or start_ns < 0:
            raise UserError(
                f"town: drive of {car}: duration {duration_ns} ns and interval {interval_ns} ns must be positive, "
                f"start {start_ns} ns not negative"
            )
        self.town, self.car, self.duration_ns = town, car, duration_ns
        self.interval_ns, self.start_ns = interval_ns, start_ns
        self.name = f"city_{car}"
        self.origin: Geodetic = ORIGIN
        text = json.dumps([town.digest, car, start_ns, interval_ns])
        self.picture_prefix = hashlib.sha256(text.encode()).hexdigest()[:48]
        self.car_key = int(self.picture_prefix[:16], 16)
        count = math.ceil(duration_ns / interval_ns)
        self.frames: Mapping[str, Sequence[TownFrame]] = {name: TownFrames(self, name, count) for name in BASELINES_M}

    @functools.cached_property
    def course(self) -> routes.Course:
        """Where the car is, at any time of the drive."""
        return self.town.course(self.car, self.start_ns, self.start_ns + self.duration_ns)

    def position(self, t_ns: int) -> tuple[float, float]:
        """East and north of the car [m], ``t_ns`` after the drive's first frame."""
        east_m, north_m, *_ = self.course.at((self.start_ns + t_ns) * 1e-9)
        return east_m, north_m
