"""A thousand cars in SUMO's traffic for a minute, and as many in a generated town: the cost.

    python -m benchmarks.traffic_speed make FOLDER          needs SUMO (pip install eclipse-sumo)
    python -m benchmarks.traffic_speed traffic FOLDER [--duration "60 s"]
    python -m benchmarks.traffic_speed town FOLDER [--duration "60 s"] [--cars 1083]

``make`` writes a grid of 23 x 23 junctions with traffic lights, 1,400 trips between random streets,
and the floating-car data of a minute. The other steps run Genie with the settings of
``fleet_1000`` and print frames, processor time (of everything, from reading to the report) and the
most memory. ``--cars`` are as many as drove in the traffic.
"""

from __future__ import annotations

import argparse
import resource
import subprocess
import time
from pathlib import Path
from random import Random
from typing import Any
from xml.etree import ElementTree

from genie_sim import files, runner
from genie_sim.scenario.scenario import read_scenario
from genie_sim.scenario.yaml_input import read_mapping

TRIPS, DEPART_EVERY_S = 1400, 0.12
KINDS = {"passenger": 90, "truck": 7, "bus": 3}
SEED = 1  # of the trips, and of SUMO
BEGIN_S, END_S = 200, 262
EQUIPPED = 0.83


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("step", choices=("make", "traffic", "town"))
    parser.add_argument("folder", type=Path)
    parser.add_argument("--duration", default="60 s")
    parser.add_argument("--cars", type=int, default=1083)
    given = parser.parse_args()
    if given.step == "make":
        make(given.folder)
        return
    settings = read_mapping(files.find(files.SCENARIO, "fleet_1000"))
    settings["name"] = given.step
    if given.step == "traffic":
        fcd = str(given.folder / "traffic.xml")
        settings["perception"] = {"source": "traffic", "fcd": fcd, "equipped": EQUIPPED}
        del settings["fleet"]["cars"]
    else:
        settings["fleet"]["cars"] = given.cars
    settings["perception"]["duration"] = given.duration
    print(cost(settings, given.folder))


def make(folder: Path) -> None:
    """Has SUMO's programs write a network and what drives on it."""
    folder.mkdir(parents=True, exist_ok=True)
    net, trips = folder / "grid.net.xml", folder / "trips.xml"
    grid = ["--grid", "--grid.number", "23", "--grid.length", "150", "--grid.attach-length", "100"]
    lanes = ["--default.lanenumber", "1", "--default-junction-type", "traffic_light"]
    subprocess.run(["netgenerate", *grid, *lanes, "-o", str(net)], check=True)
    streets = sorted(
        edge.attrib["id"]
        for edge in ElementTree.parse(net).getroot().iter("edge")
        if "function" not in edge.attrib
    )
    random = Random(SEED)
    lines = ['<routes><vType id="passenger"/>', '<vType id="truck" vClass="truck"/>']
    lines.append('<vType id="bus" vClass="bus"/>')
    for number in range(TRIPS):
        (kind,) = random.choices(list(KINDS), list(KINDS.values()))
        begin, end = random.sample(streets, 2)
        lines.append(
            f'<trip id="{kind}.{number}" type="{kind}" depart="{number * DEPART_EVERY_S:.2f}" '
            f'from="{begin}" to="{end}"/>'
        )
    trips.write_text("\n".join([*lines, "</routes>"]))
    times = ["--end", str(END_S), "--step-length", "0.1", "--seed", str(SEED)]
    fcd = ["--device.fcd.begin", str(BEGIN_S), "--fcd-output", str(folder / "traffic.xml")]
    columns = ["--fcd-output.attributes", "x,y,angle,type", "--no-step-log", "--no-warnings"]
    subprocess.run(["sumo", "-n", str(net), "-r", str(trips), *times, *fcd, *columns], check=True)


def cost(settings: dict[str, Any], folder: Path) -> str:
    """What a run to a result folder takes."""
    begin_s = time.process_time()
    run = runner.run_to_folder(read_scenario(settings), folder / "results")
    passed_s = time.process_time() - begin_s
    frames = len(run.tables["frames"])
    cars = len(run.tables["frames"]["car"].unique())
    peak_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
    return (
        f"{cars:,} cars, {frames:,} frames, {passed_s:.0f} s: {frames / passed_s:,.0f} frames a "
        f"second of processor time, at most {peak_mb:,.0f} MB"
    )


if __name__ == "__main__":
    main()
