"""What a town costs: to build it, a drive, a frame, and a look of its detector.

    python benchmarks/town_speed.py [--blocks 40] [--cars 200] [--frames 96]

Figures are of this machine and moment: the least of some rounds, in processor time of one thread.
Frames are looked at as a simulator does: one of each car, then the next of each.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator
from itertools import chain
from typing import Any

from genie_sim.town import Town, TownFrame, TownRules

ROUNDS = 5


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--blocks", type=int, default=40)
    parser.add_argument("--cars", type=int, default=200)
    parser.add_argument("--frames", type=int, default=96)
    arguments = parser.parse_args()

    Town(TownRules(blocks=(1, 1)), 1)  # reads the laws
    rules = TownRules(blocks=(arguments.blocks, arguments.blocks))
    print(
        f"town of {arguments.blocks} x {arguments.blocks} blocks  "
        f"{_seconds(lambda: Town(rules, 1).streets):8.2f} s"
    )
    town = Town(rules, 1)
    duration_ns = arguments.frames * 100_000_000
    drives = [town.drive(f"car{k}", duration_ns) for k in range(arguments.cars)]
    _tell(
        "drive",
        lambda: [town.drive(f"car{k}", duration_ns).course for k in range(arguments.cars)],
        arguments.cars,
    )
    count = arguments.frames * len(drives)

    def frames() -> Iterator[TownFrame]:
        return chain.from_iterable(zip(*(drive.frames["02"] for drive in drives), strict=True))

    _tell("frame", lambda: [frame.pose for frame in frames()], count)
    found = sum(len(frame.detections) for frame in frames()) / count
    _tell(
        f"frame and detections ({found:.1f} a frame)",
        lambda: [len(frame.detections) for frame in frames()],
        count,
    )
    _tell("frame and truth", lambda: [len(frame.truth()) for frame in frames()], count)


def _seconds(action: Callable[[], Any]) -> float:
    least_s = float("inf")
    for _ in range(ROUNDS):
        begin_s = time.process_time()
        action()
        least_s = min(least_s, time.process_time() - begin_s)
    return least_s


def _tell(what: str, action: Callable[[], Any], count: int) -> None:
    print(f"{what:35} {_seconds(action) / count * 1e6:8.1f} us")


if __name__ == "__main__":
    main()
