"""Cars that are alike and play one drive: the ``convoy:`` section, short for ``cars`` and ``edges``."""

from typing import Annotated, Any, Self

from pydantic import Field, model_validator

from genie_sim.scenario.fields import Duration, Listed, Model, problem
from genie_sim.scenario.links import Link
from genie_sim.scenario.parts import Route
from genie_sim.units import duration_text

MOST_CARS = 1_000  # more of them are a fleet


class Convoy(Model):
    """So many cars, each ``start_every_ns`` later and ``ahead_ns`` further along the drive than the one before it; the
    routes are otherwise that of the first. ``edges`` are the devices of the edge servers, which cars are given to in
    turn: with fewer of them than cars, some are shared."""

    cars: Annotated[int, Field(ge=1, le=MOST_CARS)]
    device: str
    edges: Annotated[tuple[str, ...], Listed] = ()
    link: Link | None = None
    route: Route = Route()
    start_every_ns: Duration = Field(default=0, alias="start_every")
    ahead_ns: Duration = Field(default=0, alias="ahead")

    @model_validator(mode="after")
    def _has_somewhere_to_drive(self) -> Self:
        if self.ahead_ns and self.route.window_ns is None:
            problem("ahead", "needs 'route.window', the part of the drive that the first car plays")
        return self

    def expanded(self) -> dict[str, Any]:
        """The same as ``cars`` and ``edges``, as in YAML: car1, car2, ... and edge1, edge2, ..."""
        edges = [
            {"name": f"edge{place}", "device": device} for place, device in enumerate(self.edges, 1)
        ]
        return {"edges": edges, "cars": [self._car(place) for place in range(self.cars)]}

    def _car(self, place: int) -> dict[str, Any]:
        route = self.route.model_dump(mode="json", by_alias=True)
        route["start"] = duration_text(self.route.start_ns + place * self.start_every_ns)
        if self.route.window_ns is not None:
            route["window"] = [
                duration_text(t_ns + place * self.ahead_ns) for t_ns in self.route.window_ns
            ]
        edge = f"edge{place % len(self.edges) + 1}" if self.edges else None
        return {
            "name": f"car{place + 1}",
            "device": self.device,
            "edge": edge,
            "link": self.link,
            "route": route,
        }
