"""The command ``import tables``. Everything heavy is imported after the arguments are parsed."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from genie_sim.base.errors import UserError
from genie_sim.cli import arguments
from genie_sim.cli.arguments import PATH


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
@click.option("--size", default="960 kB", help="What one frame takes to send.")
@click.option("--range", "range_", default="40 m", help="Truth up to this distance is judged.")
@click.option("--origin", metavar="LAT,LON,ALT", help="Where the plane lies; default: 0,0,0.")
def import_tables(
    *,
    poses: Path,
    detections: Path,
    truth: Path | None,
    out: Path,
    fov: str,
    size: str,
    range_: str,
    origin: str | None,
) -> None:
    """Turn tables of poses and detections into traces.

    \b
    genie-sim import tables poses.csv detections.csv --out traces
    genie-sim import tables poses.csv detections.csv --truth objects.csv --out traces --fov "90 deg"
    """
    from genie_sim.base import units

    place = arguments.geodetic("--origin", origin)
    fov_rad = _quantity("--fov", fov, units.angle_rad)
    if fov_rad > math.tau:
        raise UserError(f"--fov: must be at most 360 deg, but is {fov}")
    size_bytes = _quantity("--size", size, units.size_bytes)
    range_m = _quantity("--range", range_, units.length_m)
    from genie_sim.data import pose_import

    sensor = pose_import.Sensor(fov_rad, size_bytes, range_m)
    recordings = pose_import.import_recordings(
        poses, detections, truth, sensor=sensor, origin=place or pose_import.ORIGIN
    )
    for line in pose_import.write_recordings(out, recordings):
        click.echo(line)


def _quantity(option: str, text: str, read: Callable[[object], Any]) -> Any:
    """What is written with a unit and must be more than zero. Raises ``UserError``."""
    try:
        value = read(text)
    except ValueError as error:
        raise UserError(f"{option}: {error}") from error
    if value <= 0:
        raise UserError(f"{option}: must be more than zero, but is {text}")
    return value
