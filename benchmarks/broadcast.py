"""What a broadcast costs: processor time of a reception, where all cars hear each other, or some.

    python benchmarks/broadcast.py [--quick]

Cars stand in a square of 500 m and broadcast 300 bytes ten times a second. The same run in which
nobody is in range is taken off: cameras, graphs and senders. Prints a table; ``--quick`` leaves out
the hundred cars.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from benchmarks.speed import timed
from benchmarks.speed_page import table
from genie_sim.base.seeds import stream
from genie_sim.core.messages import CameraPose, Effect, Header, Message, Publish
from genie_sim.data import source
from genie_sim.runs.prepare import Prepared, prepare
from genie_sim.runs.simulate import simulate
from genie_sim.scenario.reading import read_scenario
from genie_sim.sim.method import IMAGES, OBJECTS, HostConfig, HostContext, Interceptor, Method

SQUARE_M = 500.0
MESSAGES = 2000  # of each run
RATE_HZ = 10
SIZE_BYTES = 300
HELLO = "/hello"
NOBODY_M, SOME_M, ALL_M = 0.001, 200.0, 1000.0  # ranges
CARS = (10, 30, 100)
ROUNDS = 3


@dataclass(frozen=True)
class Hello:
    """A message of 300 bytes."""

    header: Header
    size_bytes: int = SIZE_BYTES


class Telling(Method):
    """Whenever its camera takes a frame, a car broadcasts a message."""

    title = "telling"

    def on_car(self, host: HostContext) -> HostConfig:
        return HostConfig(
            interceptor=lambda *_: Teller(host.name), broadcast=(HELLO,), costs_nothing=True
        )


class Teller(Interceptor):
    receptions = 0  # of all cars

    def __init__(self, car: str) -> None:
        self.name = f"{car}/teller"

    def subscriptions(self) -> tuple[str, ...]:
        return IMAGES, HELLO

    def publications(self) -> tuple[str, ...]:
        return OBJECTS, HELLO

    def on_message(
        self, topic: str, message: Message, now_ns: int, sender: str | None = None
    ) -> list[Effect]:
        if topic == IMAGES:
            return [Publish(HELLO, Hello(message.header))]
        Teller.receptions += 1
        return []


@dataclass(frozen=True)
class Picture:
    """A frame of a car that stands."""

    stamp_ns: int
    pose: CameraPose
    digest: str = "square"
    dhash: int = 0
    size_bytes: int = 100_000
    horizontal_fov_rad: float = 1.4
    detections: tuple[Any, ...] = ()


@dataclass(frozen=True)
class Standing(source.Drive):
    frames: Mapping[str, Sequence[Picture]]
    name: str = "square"


@dataclass(frozen=True)
class Square(source.FrameSource, source.Frames):
    """Cars that stand at random places in a square, for so many seconds."""

    seconds: int

    def open(self, seed: int, origin: Any, progress: Any = None) -> Square:
        return self

    def drive(self, car: str, trace: str | None, start_ns: int) -> Standing:
        east_m, north_m = stream(1, "square", car).uniform(0.0, SQUARE_M, 2)
        pose = CameraPose(float(east_m), float(north_m), 1.6, 0.0)
        stamps_ns = range(0, self.seconds * 10**9, 10**9 // RATE_HZ)
        return Standing({"front": [Picture(stamp_ns, pose) for stamp_ns in stamps_ns]})

    def digests(self) -> Mapping[str, str]:
        return {"square": f"{self.seconds} s"}

    def provenance(self) -> Mapping[str, Any]:
        return {"square": {"made by": "benchmarks/broadcast.py"}}


def square(cars: int, range_m: float) -> Prepared:
    """So many cars whose cameras take turns."""
    scenario = {
        "name": "square",
        "methods": [f"{__name__}:Telling"],
        "perception": {
            "source": f"{__name__}:Square",
            "seconds": MESSAGES // (cars * RATE_HZ),
        },
        "cameras": [{"name": "front", "recording": "front"}],
        "broadcast": {"medium": "sidelink", "range": f"{range_m} m"},
        "record": [],
        "edges": [],
        "cars": [
            {
                "name": f"car{number}",
                "device": "jetson_tx2",
                "route": {"start": f"{number * 1000 // (cars * RATE_HZ)} ms"},
            }
            for number in range(cars)
        ],
    }
    return prepare(read_scenario(scenario))


class Cost(NamedTuple):
    cpu_s: float
    receptions: int


def cost(prepared: Prepared) -> Cost:
    Teller.receptions = 0
    cpu_s, _ = timed(lambda: simulate(prepared))
    return Cost(cpu_s, Teller.receptions)


def rows(fleets: Sequence[int]) -> list[tuple[str, ...]]:
    """One for each fleet and range."""
    found = []
    for cars in fleets:
        alone = square(cars, NOBODY_M)
        for text, range_m in (("some", SOME_M), ("all", ALL_M)):
            prepared = square(cars, range_m)
            pairs = [(cost(alone), cost(prepared)) for _ in range(ROUNDS)]
            receptions = pairs[0][1].receptions
            own_s = median(one.cpu_s for one, _ in pairs)
            us = 1e6 * median(both.cpu_s - one.cpu_s for one, both in pairs) / receptions
            message_us = 1e6 * own_s / MESSAGES
            each = receptions / MESSAGES
            found.append(
                (
                    f"{cars}",
                    text,
                    f"{each:.1f}",
                    f"{receptions:,}",
                    f"{message_us:.0f}",
                    f"{us:.1f}",
                )
            )
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n\n")[0])
    parser.add_argument("--quick", action="store_true", help="without the hundred cars")
    fleets = CARS[:-1] if parser.parse_args().quick else CARS
    header = (
        "cars",
        "in range",
        "receptions of a message",
        "receptions",
        "processor time of a message that nobody hears [µs]",
        "of each reception [µs]",
    )
    print(table(header, rows(fleets), left=2))


if __name__ == "__main__":
    main()
