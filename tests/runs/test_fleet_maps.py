"""Fleets on maps other than the town: a source of frames of the user's own."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import pytest

from genie_sim.base.errors import UserError
from genie_sim.base.units import NS_PER_MS, NS_PER_S
from genie_sim.core.messages import CameraPose, Detection
from genie_sim.data.frame_source import Drive, Drives, FrameSource
from genie_sim.runs.folder import run_in_memory
from genie_sim.runs.prepare import prepare
from genie_sim.scenario.reading import read_scenario
from genie_sim.scenario.scenario import Scenario

WEST_M, SOUTH_M = -1000.0, 5000.0
SPEED_MPS = 20.0


@dataclass(frozen=True)
class Frame:
    stamp_ns: int
    pose: CameraPose
    digest: str
    dhash: int
    detections: tuple[Detection, ...] = ()
    size_bytes: int = 1000
    horizontal_fov_rad: float = 1.4


@dataclass(frozen=True)
class Way(Drive):
    """East through the map, from its western border on."""

    car: str
    start_m: float = 0.0
    duration_ns: int = 10 * NS_PER_S

    @property
    def name(self) -> str:
        return f"way of {self.car}"

    @property
    def frames(self) -> Mapping[str, list[Frame]]:
        return {"front": [self._frame(n) for n in range(self.duration_ns // (500 * NS_PER_MS))]}

    def position(self, t_ns: int) -> tuple[float, float]:
        return WEST_M + self.start_m + SPEED_MPS * t_ns / NS_PER_S, SOUTH_M + 50.0

    def _frame(self, number: int) -> Frame:
        stamp_ns = number * 500 * NS_PER_MS
        pose = CameraPose(*self.position(stamp_ns), 1.6, 0.0)
        return Frame(stamp_ns, pose, f"{self.car} {number}", number)


@dataclass
class Plain(FrameSource, Drives):
    """A plain of 300 m x 100 m. ``asked`` is what drives were asked for: car, trace, start."""

    seeded: bool = False
    start_m: float = 0.0
    extent_m: tuple[float, float, float, float] = (WEST_M, SOUTH_M, WEST_M + 300.0, SOUTH_M + 100.0)
    asked: list[tuple[str, str | None, int]] = field(default_factory=list)

    def open(self, seed: int, origin: Any, progress: Any = None) -> Plain:
        return type(self)()

    def drive(self, car: str, trace: str | None, start_ns: int) -> Way:
        self.asked.append((car, trace, start_ns))
        return Way(car, self.start_m)

    def digests(self) -> dict[str, str]:
        return {"plain": "300 m x 100 m"}

    def provenance(self) -> dict[str, dict[str, str]]:
        return {"plain": {"made by": "a test"}}


class Traffic(Plain):
    """Brings two cars of its own."""

    def starts_ns(self) -> dict[str, int]:
        return {"veh_7": 0, "veh_9": 3 * NS_PER_S}


class Nowhere(Plain):
    def __init__(self) -> None:
        super().__init__(start_m=math.nan)


class Flat(Plain):
    def __init__(self) -> None:
        super().__init__(extent_m=(0.0, 0.0, 300.0, 0.0))


class NoMap(FrameSource, Drives):
    """A source whose cars have no place at any time."""

    seeded = False

    def open(self, seed: int, origin: Any, progress: Any = None) -> NoMap:
        return self

    def drive(self, car: str, trace: str | None, start_ns: int) -> Way:
        return Way(car)

    def digests(self) -> dict[str, str]:
        return {}

    def provenance(self) -> dict[str, dict[str, str]]:
        return {}


def on_map(source: str, **fleet: Any) -> Scenario:
    return read_scenario(
        {
            "name": "plain",
            "methods": ["local", "remote"],
            "perception": {"source": f"{__name__}:{source}"},
            "start_jitter": "0 s",
            "cameras": [{"name": "front", "recording": "front"}],
            "fleet": {
                "devices": "jetson_tx2",
                "edge_device": "rtx_a4500",
                "cell": "100 m",
                "hysteresis": "5 m",
                **fleet,
            },
        }
    )


def test_a_fleet_drives_on_a_map_that_begins_anywhere():
    prepared = prepare(on_map("Plain", cars=2))
    assert [edge.name for edge in prepared.scenario.edges] == ["edge_0_0", "edge_1_0", "edge_2_0"]
    assert [car.edge for car in prepared.scenario.cars] == ["edge_0_0", "edge_0_0"]
    edges = [fault.fault.parameters["edge"] for fault in prepared.scenario.faults]
    assert edges == ["edge_1_0"] * 2, "after 10 s at 20 m/s it is at the border of the third cell"


def test_a_map_that_has_cars_says_when_they_start():
    prepared = prepare(on_map("Traffic"))
    frames: Any = prepared.frames
    assert frames.asked == [("veh_7", None, 0), ("veh_9", None, 3 * NS_PER_S)]
    begins = [
        (fault.fault.parameters["target"], fault.begin_ns) for fault in prepared.scenario.faults
    ]
    assert begins[1][1] is not None and begins[0][1] is not None
    assert [name for name, _ in begins] == ["veh_7", "veh_9"]
    assert begins[1][1] - begins[0][1] == 3 * NS_PER_S
    run = run_in_memory(on_map("Traffic"))
    first_ns = run.frames[run.frames["method"] == "local"].groupby("car")["stamp_ns"].min()
    assert dict(first_ns) == {"veh_7": 0, "veh_9": 3 * NS_PER_S}


@pytest.mark.parametrize(
    ("source", "fleet", "message"),
    [
        ("Plain", {}, "fleet.cars: missing"),
        ("Traffic", {"cars": 5}, "fleet.cars: .*Traffic has 2 cars of its own: leave it out"),
        ("NoMap", {"cars": 2}, "fleet: needs a town to drive in"),
        ("Nowhere", {"cars": 2}, "car1 is at no place of the map"),
        ("Flat", {"cars": 2}, "fleet: the map has no extent"),
        ("Plain", {"cars": 2, "cell": "1 cm"}, "fleet.cell: makes more than 100,000 edges"),
        ("Plain", {"cars": 2, "cell": "1e-9 m"}, "fleet.cell: makes more than 100,000 edges"),
    ],
)
def test_what_does_not_fit_a_map_is_refused_in_one_line(source, fleet, message):
    with pytest.raises(UserError, match=message) as error:
        prepare(on_map(source, **fleet))
    assert "\n" not in str(error.value)


def test_a_route_may_name_what_only_its_source_knows():
    scenario = read_scenario(
        {
            "name": "plain",
            "methods": ["local"],
            "perception": {"source": f"{__name__}:Plain"},
            "start_jitter": "0 s",
            "cameras": [{"name": "front", "recording": "front"}],
            "cars": [{"name": "car1", "device": "jetson_tx2", "route": {"trace": "veh 7"}}],
        }
    )
    frames: Any = prepare(scenario).frames
    assert frames.asked == [("car1", "veh 7", 0)]
