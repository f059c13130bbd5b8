"""Measures the laws of detectors on development drives and writes them where the package reads
them.

    GENIE_SIM_KITTI=... GENIE_SIM_WEIGHTS=... python -m benchmarks.detector_laws

The drives: raw 2011_09_26/0005 for detectors of pictures, tracking/0000 (the same street, with
published detections) for ``pointrcnn`` and ``rrc``, and ten cars of ``fleet_30`` under seed 11 for
the detector of the generated town.
``GENIE_SIM_WEIGHTS`` names the folder of the networks' weights.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from typing import Any

from genie_sim.core.freshness.measure import measured
from genie_sim.core.messages import Header, Look
from genie_sim.data.detector import DetectorSettings
from genie_sim.data.perceive import DriveFrames, perceive
from genie_sim.runs.prepare import prepare
from genie_sim.scenario.reading import load_scenario
from genie_sim.version import PACKAGE_FOLDER
from genie_sim.worlds.town.town import drive_name

OUT = PACKAGE_FOLDER / "perception" / "detector_laws.json"
DRIVE, SEQUENCE, TOWN_SEED, TOWN_CARS = "2011_09_26/0005", "tracking/0000", 11, 10
DIGITS = 4


def looks(drive: Any, recording: str) -> Iterator[Look]:
    """The looks of a detector at what one camera sees on a drive."""
    for frame in drive.frames[recording]:
        header = Header(frame.stamp_ns, recording, drive.name)
        yield Look(header, frame.pose, frame.horizontal_fov_rad, frame.detections)


def laws(drives: list[Any], name: str, recordings: tuple[str, ...]) -> dict[str, Any]:
    """What was measured, on drives of that name."""
    seen = [list(looks(drive, recording)) for drive in drives for recording in recordings]
    tables = measured(seen)._asdict()
    rounded = {name: [round(value, DIGITS) for value in table] for name, table in tables.items()}
    return {"drives": [name], "looks": sum(map(len, seen)), **rounded}


def town() -> dict[str, Any]:
    """Of the generated town's detector."""
    scenario = load_scenario("fleet_30", seed=TOWN_SEED)
    prepared = prepare(scenario)
    drives = [prepared.drives[car.name] for car in prepared.scenario.cars[:TOWN_CARS]]
    return laws(drives, drive_name(TOWN_SEED), ("02",))


def recorded(detector: str, drive: str, cameras: tuple[str, ...]) -> dict[str, Any]:
    """Of a detector on a drive of KITTI's."""
    trace = perceive(None, DriveFrames(drive, cameras), DetectorSettings(detector))
    return laws([trace], drive, cameras)


def main() -> None:
    """Writes the file."""
    known = {name: recorded(name, DRIVE, ("02", "03")) for name in ("yolox_nano", "nanodet_m")}
    known |= {name: recorded(name, SEQUENCE, ("02",)) for name in ("pointrcnn", "rrc")}
    known["town"] = town()
    rows = [f"{json.dumps(name)}: {table(facts)}" for name, facts in known.items()]
    OUT.write_text("{\n" + ",\n".join(rows) + "\n}\n", encoding="utf-8")


def table(facts: Mapping[str, Any]) -> str:
    """One fact a line."""
    lines = [f"  {json.dumps(name)}: {json.dumps(value)}" for name, value in facts.items()]
    return "{\n" + ",\n".join(lines) + "\n}"


if __name__ == "__main__":
    main()
