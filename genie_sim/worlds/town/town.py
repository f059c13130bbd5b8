"""The town: its streets and people, made from rules and a seed alone, and the drives of any cars
through it.
"""

import functools
import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict

from genie_sim.base.errors import UserError
from genie_sim.worlds.scene.frames import SceneDrive
from genie_sim.worlds.scene.kept_words import TOWN_DETECTOR, TOWN_DRAWS, town_drive
from genie_sim.worlds.scene.objects import ObjectColumns
from genie_sim.worlds.scene.scene import Scene
from genie_sim.worlds.scene.source import SceneSource
from genie_sim.worlds.town import routes
from genie_sim.worlds.town.commuting import Commuting
from genie_sim.worlds.town.places import Places
from genie_sim.worlds.town.rules import TownRules
from genie_sim.worlds.town.streets import Street, lay_out


class Town(Scene):
    """A town with everything that stands and moves in it.

    The same rules and seed give the same town; it is laid out at the first look. Its clock starts
    at 0; what moves is where it is at that time for every car that looks.
    """

    name, random_name = "town", TOWN_DRAWS
    on_grid = True

    def __init__(self, rules: TownRules, seed: int, range_m: float = SceneSource.range_m) -> None:
        """Up to ``range_m`` it is known what is really in view, however near a detector looks."""
        if seed < 0:
            raise UserError(f"town: seed: {seed} is negative")
        super().__init__(seed, rules.view_m, range_m)
        self.rules = rules
        text = json.dumps(
            [f"{self.random_name} 1", asdict(rules), seed, self.laws.digest], sort_keys=True
        )
        self.digest = hashlib.sha256(text.encode()).hexdigest()
        self.size_m = (rules.blocks[0] * rules.block_m, rules.blocks[1] * rules.block_m)

    @functools.cached_property
    def streets(self) -> list[Street]:
        """Every street with what stands and moves on it: those that lead east, from the south on,
        and then those that lead north, from the west on.
        """
        columns, rows = self.rules.blocks
        ghosts_per_100m = self.laws.ghosts_per_100m
        return [
            lay_out(
                self.rules,
                ghosts_per_100m,
                northbound,
                number,
                random=self.random("north" if northbound else "east", number),
            )
            for northbound, count in ((False, rows + 1), (True, columns + 1))
            for number in range(count)
        ]

    @functools.cached_property
    def objects(self) -> ObjectColumns:
        """All that stands and moves in the town, street by street."""
        items = [item for street in self.streets for item in street.objects]
        return ObjectColumns(
            [item.label for item in items],
            [item.number for item in items],
            [item.real for item in items],
            laws=self.laws,
            seed_key=self.key,
        )

    @functools.cached_property
    def visibility(self) -> Places:
        """Where everything is, and what every camera in the town has in view."""
        return Places(self.rules, self.streets, self.objects, self.sight_m)

    @functools.cached_property
    def _commuting(self) -> Commuting:
        return Commuting(self.rules, self.random("destinations"))

    def drive(
        self, car: str, duration_ns: int, interval_ns: int = 100_000_000, start_ns: int = 0
    ) -> SceneDrive:
        """What the cameras of one car see, a frame every ``interval_ns``, from ``start_ns`` on the
        town's clock on.

        The route is the car's own: it depends on the town and the car's name alone. Raises
        UserError for times that leave no frame.
        """

        def course() -> routes.PiecewiseCourse:
            random = self.random("car", car)
            begin_s, end_s = start_ns * 1e-9, (start_ns + duration_ns) * 1e-9
            return routes.drive(self._commuting, random, begin_s, end_s)

        return SceneDrive(
            self,
            car,
            course,
            duration_ns=duration_ns,
            interval_ns=interval_ns,
            start_ns=start_ns,
        )

    def facts(self) -> Mapping[str, object]:
        drive, rules = town_drive(self.seed), asdict(self.rules)
        return {"detector": TOWN_DETECTOR, "drive": drive, "rules": rules}
