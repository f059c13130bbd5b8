"""Cars that are alike and play one drive: the ``convoy:`` section, short for ``cars`` and
``edges``.
"""

from dataclasses import dataclass, field, replace
from typing import Annotated, Any

from genie_sim.base.plugins import Choice
from genie_sim.base.settings import Bounds, SettingError, plain_data
from genie_sim.sim.link_models.presets import LINK
from genie_sim.sim.settings import Route

MAX_CARS = 1_000  # more of them are a fleet


@dataclass(frozen=True, kw_only=True)
class Convoy:
    """Cars that replay one drive one after the other. Their routes are that of the first one but
    for ``start_every`` and ``ahead``.
    """

    cars: Annotated[int, Bounds(minimum=1, maximum=MAX_CARS)]
    """Number of cars."""

    device: str
    """The device of every car, by name or path."""

    edges: tuple[str, ...] = ()
    """The devices of the edges, which are assigned to the cars in turn. `[quadro_rtx_4000,
    agx_xavier, agx_xavier]` gives one powerful server among the edges of three cars,
    `[quadro_rtx_4000]` one that all cars share; without any, cars are on their own."""

    link: Annotated[Choice, LINK] | None = None
    """The link of every car, with the settings of `edge_network`."""

    route: Route = field(default_factory=Route)
    """The route of the first car, with the settings of `cars[].route`; the others' are the same but
    for `start_every` and `ahead`."""

    start_every_ns: int = 0
    """How much later each car starts than the one before it."""

    ahead_ns: int = 0
    """How much later in the drive each car's window begins and ends than that of the car before
    it."""

    def __post_init__(self) -> None:
        if self.ahead_ns and self.route.window_ns is None:
            text = "needs 'route.window', the part of the drive that the first car plays"
            raise SettingError("ahead", text)

    def expanded(self) -> dict[str, Any]:
        """The same as ``cars`` and ``edges``, as in YAML: car1, car2, ... and edge1, edge2, ..."""
        edges = [
            {"name": f"edge{number}", "device": device}
            for number, device in enumerate(self.edges, 1)
        ]
        return {"edges": edges, "cars": [self._car(place) for place in range(self.cars)]}

    def _car(self, place: int) -> dict[str, Any]:
        route = replace(self.route, start_ns=self.route.start_ns + place * self.start_every_ns)
        if route.window_ns is not None:
            begin_ns, end_ns = route.window_ns
            later_ns = place * self.ahead_ns
            route = replace(route, window_ns=(begin_ns + later_ns, end_ns + later_ns))
        edge = f"edge{place % len(self.edges) + 1}" if self.edges else None
        return {
            "name": f"car{place + 1}",
            "device": self.device,
            "edge": edge,
            "link": self.link,
            "route": plain_data(route),
        }
