"""The town: its streets and people, made from rules and a seed alone, and the drives of any cars
through it.
"""

import functools
import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict

from genie_sim.base.errors import UserError
from genie_sim.base.geometry import Array, Geodetic
from genie_sim.base.seeds import stream
from genie_sim.worlds.scene.detector import SyntheticDetector
from genie_sim.worlds.scene.frames import SceneDrive
from genie_sim.worlds.scene.laws import FittedLaws, synthetic_laws
from genie_sim.worlds.scene.noise import key_of_seed
from genie_sim.worlds.scene.objects import ObjectColumns, SceneObject
from genie_sim.worlds.scene.surrogate import LAWS
from genie_sim.worlds.scene.view import VisibleObjects
from genie_sim.worlds.town import routes
from genie_sim.worlds.town.places import Places
from genie_sim.worlds.town.rules import TownRules
from genie_sim.worlds.town.streets import Layout, Street, Streets, lay_out

# near Karlsruhe, where KITTI was recorded; the town itself is made up
ORIGIN: Geodetic = (49.0, 8.4, 115.0)
DETECTOR = "town"  # what the town's detector is called
# Names the random numbers, here and in digests: another word makes another town of every seed.
STREAM = "city"


def drive_name(seed: int) -> str:
    """What drives through the town of a seed are called."""
    return f"town/{seed}"


class Town:
    """A town with everything that stands and moves in it.

    The same rules and seed give the same town; it is laid out at the first look. Its clock starts
    at 0; what moves is where it is at that time for every car that looks. ``digest`` is the sha256
    of what decides it: rules, seed, laws.
    """

    name = "town"

    def __init__(self, rules: TownRules, seed: int) -> None:
        if seed < 0:
            raise UserError(f"town: seed: {seed} is negative")
        self.rules, self.seed = rules, seed
        self.laws: FittedLaws = synthetic_laws()
        text = json.dumps([f"{STREAM} 1", asdict(rules), seed, self.laws.digest], sort_keys=True)
        self.digest = hashlib.sha256(text.encode()).hexdigest()
        self.key = key_of_seed(STREAM, seed)
        self.size_m = (rules.blocks[0] * rules.block_m, rules.blocks[1] * rules.block_m)

    @functools.cached_property
    def streets(self) -> Streets:
        """Every street with what stands and moves on it."""
        columns, rows = self.rules.blocks

        layout = Layout(self.rules, self.laws, self.key)

        def streets(name: str, blocks: int) -> list[Street]:
            return [
                lay_out(layout, name == "north", k, stream(self.seed, STREAM, name, k))
                for k in range(blocks + 1)
            ]

        return Streets(
            self.rules.block_m,
            self.rules.street_half_m,
            streets("east", rows),
            streets("north", columns),
        )

    @functools.cached_property
    def detector(self) -> SyntheticDetector:
        """The detector of every camera in the town."""
        return SyntheticDetector(self.objects, self.laws)

    @functools.cached_property
    def objects(self) -> ObjectColumns:
        """All that stands and moves in the town, street by street."""
        streets = (*self.streets.east, *self.streets.north)
        return ObjectColumns([item for street in streets for item in street.objects])

    @functools.cached_property
    def visibility(self) -> Places:
        """Where everything is, and what every camera in the town has in view."""
        return Places(self.streets, self.objects, self.rules.view_m)

    def truth(self, visible: VisibleObjects, t_s: Array) -> list[SceneObject | None]:
        """The objects that are visible from some poses, as they are then; a ghost is ``None``."""
        rows, offsets = visible.row.tolist(), visible.number_offset.tolist()
        columns = zip(rows, offsets, visible.east_m.tolist(), visible.north_m.tolist(), strict=True)
        objects = self.objects.rows
        return [
            item.at(item.number - offset, east_m, north_m) if (item := objects[row]).real else None
            for row, offset, east_m, north_m in columns
        ]

    @functools.cached_property
    def _commuting(self) -> routes.Commuting:
        return routes.Commuting(self.rules, stream(self.seed, STREAM, "destinations"))

    def drive(
        self, car: str, duration_ns: int, interval_ns: int = 100_000_000, start_ns: int = 0
    ) -> "TownDrive":
        """What the cameras of one car see, a frame every ``interval_ns``, from ``start_ns`` on the
        town's clock on.

        The route is the car's own: it depends on the town and the car's name alone. Raises
        UserError for times that leave no frame.
        """
        return TownDrive(
            self, car, duration_ns=duration_ns, interval_ns=interval_ns, start_ns=start_ns
        )

    @property
    def provenance(self) -> Mapping[str, object]:
        """Where it comes from, for ``run.json``."""
        laws = {"laws": dict(self.laws.provenance), "laws_digest": self.laws.digest}
        features = dict.fromkeys(LAWS, "surrogate")
        return {
            "source": "town",
            "detector": DETECTOR,
            "drive": drive_name(self.seed),
            "rules": asdict(self.rules),
            "seed": self.seed,
            **laws,
            "features": features,
        }

    def course(self, car: str, start_ns: int, end_ns: int) -> routes.Course:
        """Where a car is from ``start_ns`` to ``end_ns``."""
        random = stream(self.seed, STREAM, "car", car)
        return routes.drive(self._commuting, random, start_ns * 1e-9, end_ns * 1e-9)


class TownDrive(SceneDrive):
    """What the cameras of one car see in a town.

    ``origin`` is latitude [deg], longitude [deg], altitude [m].
    """

    origin = ORIGIN
    scene: Town

    def __init__(
        self, town: Town, car: str, *, duration_ns: int, interval_ns: int, start_ns: int
    ) -> None:
        if interval_ns <= 0 or duration_ns <= 0 or start_ns < 0:
            raise UserError(
                f"town: drive of {car}: duration {duration_ns} ns and interval {interval_ns} ns "
                f"must be positive, start {start_ns} ns not negative"
            )
        super().__init__(
            town, car, duration_ns=duration_ns, interval_ns=interval_ns, start_ns=start_ns
        )

    @functools.cached_property
    def course(self) -> routes.Course:
        return self.scene.course(self.car, self.start_ns, self.start_ns + self.duration_ns)
