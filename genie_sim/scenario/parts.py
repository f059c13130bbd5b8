"""Who drives where in a scenario: edges, cars with their cameras, links and routes."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Annotated, Any, Self

from pydantic import BeforeValidator, Discriminator, Field, Tag, model_validator

from genie_sim import units
from genie_sim.errors import short_repr
from genie_sim.scenario.fields import Count, Duration, Listed, Model, Name, PositiveSize, problem
from genie_sim.scenario.links import Link


def unique(field: str, names: Sequence[str], of: str = "", also: Iterable[str] = ()) -> None:
    seen = set(also)
    for index, name in enumerate(names):
        if name in seen:
            problem(f"{field}[{index}]{of}", f"duplicate name {name!r}")
        seen.add(name)


class Camera(Model):
    """One stream of every car: which recording stands for it, at which phase, and how large its images are.

    ``size_bytes`` of ``None`` is the recorded size.
    """

    name: Name
    recording: Name
    phase_ns: Duration = Field(default=0, alias="phase")
    size_bytes: PositiveSize | None = Field(default=None, alias="size")


# KITTI's two colour and two grey cameras at 10 Hz, at staggered phases. The grey ones are not recorded: a colour one
# stands for each, with the size of a mono8 image, a third of the bytes.
FOUR_CAMERAS = (
    Camera(name="camera_02", recording="02"),
    Camera.model_construct(name="camera_03", recording="03", phase_ns=25 * units.NS_PER_MS),
    Camera.model_construct(
        name="camera_00", recording="02", phase_ns=50 * units.NS_PER_MS, size_bytes=465_800
    ),
    Camera.model_construct(
        name="camera_01", recording="03", phase_ns=75 * units.NS_PER_MS, size_bytes=465_800
    ),
)


class Edge(Model):
    """An edge server. It shares with its ``neighbours`` over the edge network; ``None`` for all other edges."""

    name: Name
    device: str
    neighbours: Annotated[tuple[Name, ...], Listed] | None = None


class Route(Model):
    """Which part of a trace a car drives, when, and how often.

    ``trace`` of ``None`` is the scenario's, ``window_ns`` of ``None`` the whole drive. ``start_ns`` is when the car
    sets off, ``pause_ns`` the time between two laps.
    """

    trace: str | None = None
    window_ns: Annotated[tuple[Duration, Duration], Listed] | None = Field(
        default=None, alias="window"
    )
    start_ns: Duration = Field(default=0, alias="start")
    laps: Count = 1
    pause_ns: Duration = Field(default=units.NS_PER_S, alias="pause")

    @model_validator(mode="after")
    def _window_in_order(self) -> Self:
        if self.window_ns is not None and self.window_ns[0] >= self.window_ns[1]:
            problem("window", "must be [begin, end] with begin before end")
        return self


def _cameras(value: object) -> object:
    if not isinstance(value, bool | list | tuple):
        raise ValueError(f"must be true, false or a list of cameras, not {short_repr(value)}")
    return tuple(value) if isinstance(value, list) else value


Cameras = Annotated[
    Annotated[bool, Tag("none")] | Annotated[tuple[Camera, ...], Field(min_length=1), Tag("own")],
    Discriminator(lambda value: "own" if isinstance(value, tuple) else "none"),
    BeforeValidator(_cameras),
]


class Car(Model):
    """A car, its computer, and its link to its edge (both ``None`` for a car on its own).

    ``cameras``: ``True`` for the scenario's, or its own. Without any (``False``) it has no detector either: it asks
    with its position and lives on what others have seen.
    """

    name: Name
    device: str
    edge: str | None = None
    link: Link | None = None
    route: Route = Route()
    cameras: Cameras = True
    genie: bool = True

    @model_validator(mode="before")
    @classmethod
    def _edge_has_a_link(cls, data: Any) -> Any:
        if isinstance(data, Mapping) and data.get("edge") is not None and data.get("link") is None:
            return {**data, "link": "ethernet_1g"}
        return data

    @model_validator(mode="after")
    def _link_leads_to_an_edge(self) -> Self:
        if self.link is not None and self.edge is None:
            problem("link", "leads nowhere: the car has no 'edge'")
        if not self.cameras and (self.edge is None or not self.genie):
            problem(
                "cameras",
                "a car without cameras needs an 'edge' and 'genie: true', or nobody answers it",
            )
        if isinstance(self.cameras, tuple):
            unique("cameras", [camera.name for camera in self.cameras], ".name")
        return self
