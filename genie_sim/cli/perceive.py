"""The command ``perceive``. Everything heavy is imported after the arguments are parsed."""

from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

import click

from genie_sim.base.errors import UserError
from genie_sim.base.plugins import allow_own_code
from genie_sim.cli import arguments
from genie_sim.cli.arguments import PATH, accept_option, detector_options
from genie_sim.cli.terminal import ProgressBar, tell
from genie_sim.core.encodings import Encoding

if TYPE_CHECKING:
    from genie_sim.data.detectors.detector import DetectorSettings

DEFAULT_MIN_SCORE = 0.3
OF_DRIVE = ("accept", "out", "cameras", "min_score", "origin", "allow_missing_scans", "encoding")


@click.command()
@click.option("--drive", help="A drive: 2011_09_26/0005 or odometry/05.")
@accept_option
@click.option("--out", type=PATH, help="The trace file to write.")
@click.option("--kitti", type=PATH, help="KITTI's root folder; default: $GENIE_SIM_KITTI.")
@click.option(
    "--cameras", default="02,03", help="Cameras, separated by commas; 00 and 01 are grey."
)
@detector_options
@click.option(
    "--min-score",
    type=click.FloatRange(0.0, 1.0),
    default=DEFAULT_MIN_SCORE,
    show_default=True,
    help="Keep detections from this score on.",
)
@click.option(
    "--origin", metavar="LAT,LON,ALT", help="The world's origin; default: the drive's first fix."
)
@click.option(
    "--allow-missing-scans", is_flag=True, help="Place by the ground alone where there is no scan."
)
@click.option(
    "--check",
    metavar="TRACE",
    help="Instead: how far this environment's detections are from those of a trace of a drive.",
)
@click.option(
    "--encoding",
    type=click.Choice(get_args(Encoding)),
    default="raw",
    help="How pictures reach the detector.",
)
def perceive(
    *,
    drive: str | None,
    accept: bool,
    out: Path | None,
    kitti: Path | None,
    cameras: str,
    min_score: float,
    origin: str | None,
    allow_missing_scans: bool,
    check: str | None,
    encoding: Encoding,
    **network: Any,
) -> None:
    """Run a detector over a drive; write its trace."""
    from genie_sim.base.import_report import ImportReport
    from genie_sim.data.intake import write_told
    from genie_sim.data.kitti import perceive as perception
    from genie_sim.data.trace import check_replaceable

    allow_own_code()
    if (drive is None) == (check is None):
        raise UserError("perceive: give either --drive or --check")
    if check is not None:
        arguments.refuse("with --check", *OF_DRIVE)
        settings = arguments.detector_settings(**network, min_score=DEFAULT_MIN_SCORE)
        _check(check, perception.kitti_folder(kitti), settings)
        return
    if out is None:
        raise UserError("perceive: say with --out which file to write")
    world = arguments.geodetic("--origin", origin)
    settings = arguments.detector_settings(**network, min_score=min_score, encoding=encoding)
    assert drive is not None
    check_replaceable(out)  # before the detector runs
    root, camera_names = perception.kitti_folder(kitti), arguments.listed("--cameras", cameras)
    report = ImportReport(root, accept)
    selection = perception.FrameSelection(
        drive, camera_names, origin=world, allow_missing_scans=allow_missing_scans
    )
    with ProgressBar(unit="frames") as progress:
        trace = perception.perceive(root, selection, settings, progress=progress, report=report)
    click.echo(write_told(out, trace))
    tell(report)


def _check(name: str, kitti: Path, settings: "DetectorSettings") -> None:
    """Prints how far what is found here is from what the trace of this name keeps."""
    from genie_sim.base import files
    from genie_sim.data.kitti import trace_check
    from genie_sim.data.trace import read_trace

    trace = read_trace(files.find(files.TRACE, name))
    with ProgressBar(unit="frames") as progress:
        again = trace_check.perceive_again(kitti, trace, settings, progress)
    for line in trace_check.differences(trace, again):
        click.echo(line)
