"""Reads a take of CooperScene (B. Wu, R. Mo and others, ECCV 2026, arXiv 2606.31219): three real
cars and a roadside unit, and what C-V2X radios carried between them.

    python import_cooperscene.py cooperscene/test/10 --links links.csv --out take

A take has the folders ``0`` (the roadside unit) to ``3``, and in each of them frames ``N.yaml``
with a pose and the labels of what this agent sees, beside ``N.pcd`` and perhaps
``N_camera0.png``. Places are east, north and up of the take's origin, angles are roll, yaw and
pitch in degrees, yaw counter-clockwise from east. Frames are numbered on one clock, at 10 Hz.

It writes tables and hands them to ``genie-sim import``. What detectors found is not published: an
agent's own labels stand for it, with score 0.9 (assumed). The truth is what any agent has labelled.
"""

import argparse
import csv
import math
import sys
from collections.abc import Iterable
from itertools import pairwise
from pathlib import Path
from typing import Any

import yaml

from genie_sim.base.errors import UserError
from genie_sim.base.paths import read_text
from genie_sim.base.tables import FileColumn, read_rows
from genie_sim.cli.main import main as genie_sim

AGENTS = {"0": "roadside", "1": "car1", "2": "car2", "3": "car3"}
PERIOD_S = 0.1  # lidars turn ten times a second
SCORE = 0.9  # assumed
ITSELF_M = 2.0  # a label so near to a sensor is of the car that carries it
SCAN_BYTES = 960_000  # where no scan is there: 60,000 points of 16 bytes (assumed)
MAX_M = 1e6
LINKS = (
    FileColumn("time_s"),
    FileColumn("from", "text"),
    FileColumn("to", "text"),
    FileColumn("throughput_mbps", lowest=0.0),
    FileColumn("latency_ms", lowest=0.0),
    FileColumn("loss", lowest=0.0, highest=1.0),
    FileColumn("jitter_ms", lowest=0.0),
)


class Frame:
    """What one agent's YAML file tells: where its lidar is, and the objects it has labelled."""

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            told = yaml.load(read_text(path), getattr(yaml, "CSafeLoader", yaml.SafeLoader))
        except yaml.YAMLError as error:
            raise UserError(f"{path}: is no YAML: {' '.join(str(error).split())[:120]}") from None
        if not isinstance(told, dict):
            raise UserError(f"{path}: must be a mapping with lidar_pose and vehicles")
        self.east_m, self.north_m, self.heading_deg = self._pose(told)
        self.origin = told.get("lla_origin")
        self.objects = {}  # by id: east and north of the middle [m]
        vehicles = told.get("vehicles") or {}
        if not isinstance(vehicles, dict):
            raise UserError(f"{path}: vehicles: must be a mapping of ids")
        for name, label in vehicles.items():
            where = f"vehicles.{name}"
            if not isinstance(label, dict):
                raise UserError(f"{path}: {where}: must be a mapping with location")
            east_m, north_m, _ = self._three(f"{where}.location", label.get("location"))
            _, yaw_deg, _ = self._three(f"{where}.angle", label.get("angle", [0, 0, 0]))
            ahead_m, left_m, _ = self._three(f"{where}.center", label.get("center", [0, 0, 0]))
            cosine, sine = math.cos(math.radians(yaw_deg)), math.sin(math.radians(yaw_deg))
            east_m += cosine * ahead_m - sine * left_m
            north_m += sine * ahead_m + cosine * left_m
            self.objects[str(name)] = east_m, north_m

    def _pose(self, told: dict[str, Any]) -> tuple[float, float, float]:
        """East, north and heading: of a pose of six numbers, or of a matrix."""
        pose = told.get("lidar_pose", told.get("true_ego_pos"))
        if isinstance(pose, list) and len(pose) == 4:
            rows = [self._numbers("lidar_pose", row, 4) for row in pose]
            heading = math.degrees(math.atan2(rows[1][0], rows[0][0]))
            return rows[0][3], rows[1][3], heading
        east_m, north_m, _, _, yaw_deg, _ = self._numbers("lidar_pose", pose, 6)
        return east_m, north_m, yaw_deg

    def _three(self, field: str, value: object) -> list[float]:
        return self._numbers(field, value, 3)

    def _numbers(self, field: str, value: object, count: int) -> list[float]:
        numbers = value if isinstance(value, list) else []
        if len(numbers) == count and all(
            isinstance(number, int | float) and abs(number) <= MAX_M for number in numbers
        ):
            return [float(number) for number in numbers]
        raise UserError(f"{self.path}: {field}: must be {count} numbers, not {value!r:.60}")


def read_take(take: Path) -> dict[str, dict[int, Frame]]:
    """The frames of every agent, by their numbers. Raises ``UserError``."""
    frames: dict[str, dict[int, Frame]] = {}
    for agent in AGENTS:
        if not (take / agent).is_dir():
            raise UserError(f"{take}: agent {agent} is missing; a take has {', '.join(AGENTS)}")
        files = [path for path in (take / agent).glob("*.yaml") if path.stem.isdecimal()]
        if not files:
            raise UserError(f"{take / agent}: has no frames, such as 481260.yaml")
        frames[agent] = {int(path.stem): Frame(path) for path in sorted(files)}
    return frames


def write_tables(frames: dict[str, dict[int, Frame]], out: Path) -> tuple[Path, Path, Path]:
    """Poses, detections and the truth of all agents, on one clock. Raises ``UserError``."""
    numbers = sorted({number for of_agent in frames.values() for number in of_agent})
    step = min((later - number for number, later in pairwise(numbers)), default=1)
    poses, detections, truth = [], [], []
    for number in numbers:
        time_s = round((number - numbers[0]) / step * PERIOD_S, 6)
        seen = {agent: of_agent[number] for agent, of_agent in frames.items() if number in of_agent}
        everything = {
            name: at for frame in reversed(seen.values()) for name, at in frame.objects.items()
        }
        for agent, frame in seen.items():
            car, here = AGENTS[agent], (frame.east_m, frame.north_m)
            poses.append((car, time_s, *here, frame.heading_deg))
            detections += [(car, time_s, "car", *at, SCORE) for at in frame.objects.values()]
            for name, at in everything.items():
                if agent == "0" or math.dist(at, here) > ITSELF_M:
                    truth.append((car, time_s, name, "car", *at))
    place = ("east_m", "north_m")
    return (
        write(out / "poses.csv", ("car", "time_s", *place, "heading_deg"), poses),
        write(out / "detections.csv", ("car", "time_s", "label", *place, "score"), detections),
        write(out / "objects.csv", ("car", "time_s", "object", "label", *place), truth),
    )


def write_links(file: Path, out: Path) -> list[Path]:
    """A table for each pair of agents: the rates of both directions, and the sum of their latencies
    as round trip. Up is to the roadside unit, or to the agent with the higher number. Returns them.
    Raises ``UserError``.
    """
    ways: dict[tuple[str, str], dict[float, tuple[float, float]]] = {}
    for row in read_rows(file, LINKS):
        time_s, begin, end, rate_mbps, latency_ms, _, _ = row.values
        for name, agent in (("from", begin), ("to", end)):
            if agent not in AGENTS:
                raise UserError(f"{row.where}: {name}: must be one of {', '.join(AGENTS)}")
        ways.setdefault((begin, end), {})[time_s] = rate_mbps, latency_ms
    if not ways:
        raise UserError(f"{file}: has no rows")
    paths = []
    for begin, end in sorted(ways):
        if (end, begin) not in ways:
            raise UserError(f"{file}: has rows from {begin} to {end}, but none back")
        if begin == "0" or "0" < end < begin:
            continue  # is told with the other direction
        up, down = ways[begin, end], ways[end, begin]
        rows = []
        for time_s in sorted(up.keys() | down.keys()):
            (up_mbps, there_ms), (down_mbps, back_ms) = (
                way[max((t for t in way if t <= time_s), default=min(way))] for way in (up, down)
            )
            rows.append((time_s, up_mbps, down_mbps, there_ms + back_ms))
        titles = ("time_s", "up_mbps", "down_mbps", "rtt_ms")
        paths.append(write(out / f"{AGENTS[begin]}-{AGENTS[end]}.csv", titles, rows))
    return paths


def write(path: Path, titles: Iterable[str], rows: Iterable[Iterable[object]]) -> Path:
    """Writes a CSV file; returns its path."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows([titles, *rows])
    return path


def main(arguments: list[str] | None = None) -> int:
    """Imports a take; returns the exit status."""
    parser = argparse.ArgumentParser(description="Import a take of CooperScene.")
    parser.add_argument("take", type=Path, help="such as cooperscene/test/10")
    parser.add_argument("--links", type=Path, help="CSV: " + ", ".join(one.name for one in LINKS))
    parser.add_argument("--out", type=Path, required=True, help="the folder for what is made")
    given = parser.parse_args(arguments)
    try:
        frames = read_take(given.take)
        tables = write_tables(frames, given.out / "tables")
        links = write_links(given.links, given.out / "tables") if given.links else []
    except (UserError, OSError) as error:
        sys.stderr.write(f"import_cooperscene: {error}\n")
        return 1
    scans = [scan.stat().st_size for scan in sorted(given.take.glob("[0-3]/*.pcd"))]
    size_bytes = round(sum(scans) / len(scans)) if scans else SCAN_BYTES
    origin = next(iter(frames["0"].values())).origin
    at = ["--origin", ",".join(map(str, origin))] if isinstance(origin, list) else []
    poses, detections, truth = map(str, tables)
    command = ["import", "tables", poses, detections, "--truth", truth, *at]
    status = genie_sim([*command, "--frame-size", f"{size_bytes} B", "--out", str(given.out)])
    about = ["--source", "CooperScene", "--licence", "CC BY-NC-SA 4.0"]
    for link in links:
        out = str(given.out / f"{link.stem}.link.parquet")
        status = status or genie_sim(["import", "link", str(link), "--out", out, *about])
    return status


if __name__ == "__main__":
    sys.exit(main())
