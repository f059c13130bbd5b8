"""The command ``import tables``. Everything heavy is imported after the arguments are parsed."""

import math
from pathlib import Path

import click

from genie_sim.base.errors import UserError
from genie_sim.cli import arguments
from genie_sim.cli.arguments import PATH, accept_option, map_option
from genie_sim.cli.terminal import tell


@click.command("tables")
@click.argument(
    "poses", type=PATH, help="CSV or Parquet: car, time_s, east_m, north_m, heading_deg."
)
@click.argument(
    "detections", type=PATH, help="Of each: car, time_s, label, east_m, north_m, score."
)
@click.option("--truth", type=PATH, help="What was there: time_s, object, label, east_m, north_m.")
@click.option("--out", type=PATH, required=True, help="The folder for CAR.parquet of every car.")
@click.option("--fov", default="360 deg", help="What every sensor sees around its heading.")
@click.option("--frame-size", default="960 kB", help="What one frame takes to send.")
@click.option("--range", "range_", default="40 m", help="Truth up to this distance is judged.")
@click.option("--origin", metavar="LAT,LON,ALT", help="Where the plane lies; default: 0,0,0.")
@map_option
@accept_option
def import_tables(
    *,
    poses: Path,
    detections: Path,
    truth: Path | None,
    out: Path,
    fov: str,
    frame_size: str,
    range_: str,
    origin: str | None,
    classes: tuple[str, ...],
    accept: bool,
) -> None:
    """Turn tables of poses and detections into traces.

    \b
    genie-sim import tables poses.csv detections.csv --out traces
    genie-sim import tables poses.csv detections.csv --truth objects.csv --out traces --fov "90 deg"
    """
    from genie_sim.base import units

    if truth is None:
        arguments.refuse("without --truth", "range_")
    place = arguments.geodetic("--origin", origin)
    fov_rad = arguments.quantity("--fov", fov, units.ANGLE.read)
    if fov_rad > math.tau:
        raise UserError(f"--fov: must be at most 360 deg, but is {fov}")
    size_bytes = arguments.quantity("--frame-size", frame_size, units.size_bytes)
    range_m = arguments.quantity("--range", range_, units.length_m)
    from genie_sim.base.classes import NO_CLASS, ROAD_LABELS
    from genie_sim.base.import_report import ImportReport, class_map
    from genie_sim.data import intake, table_import
    from genie_sim.data.truth import MAX_RANGE_M
    from genie_sim.data.world_table import SOMEWHERE

    if range_m > MAX_RANGE_M:
        raise UserError(f"--range: must be at most {MAX_RANGE_M:g} m, but is {range_}")
    of_labels = class_map("--map", classes, [*ROAD_LABELS, NO_CLASS])
    report = ImportReport(poses, accept)
    sensor = table_import.Sensor(fov_rad, size_bytes, range_m)
    cars = table_import.cars_of_tables(
        poses,
        detections,
        truth,
        sensor=sensor,
        origin=place or SOMEWHERE,
        classes=of_labels,
        report=report,
    )
    for line in intake.write_cars(out, cars):
        click.echo(line)
    tell(report)
