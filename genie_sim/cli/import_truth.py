"""The command ``import truth``. Everything heavy is imported after the arguments are parsed."""

from pathlib import Path

import click

from genie_sim.cli.arguments import PATH, accept_option
from genie_sim.cli.terminal import tell


@click.command("truth")
@click.option(
    "--drive", required=True, help="The labelled drive, such as 2011_09_26/0005 or tracking/0000."
)
@click.option("--trace", required=True, help="The trace of that drive: a name or a file.")
@click.option("--kitti", type=PATH, help="KITTI's root folder; default: $GENIE_SIM_KITTI.")
@click.option(
    "--out",
    type=PATH,
    help="The file; default: NAME.truth.parquet beside the trace, where runs find it.",
)
@accept_option
def import_truth(
    *, drive: str, trace: str, kitti: Path | None, out: Path | None, accept: bool
) -> None:
    """Compute what really is there on a trace's drive.

    It comes from KITTI's labels of the drive, and lets runs on the trace tell how right their
    answers are.
    """
    from genie_sim.base import files
    from genie_sim.base.import_report import ImportReport
    from genie_sim.data import truth
    from genie_sim.data.kitti import perceive
    from genie_sim.data.kitti.drive_truth import make_truth
    from genie_sim.data.trace import read_trace

    path, root = files.find(files.TRACE, trace), perceive.kitti_folder(kitti)
    report = ImportReport(root, accept)
    table = make_truth(root, drive, read_trace(path), report)
    out = truth.path_beside(path) if out is None else out
    truth.write_truth(out, table)
    objects = {row.object: row.moving for row in table.rows}
    visible = sum(row.visible for row in table.rows)
    click.echo(
        f"{out}: {len(objects)} objects, {sum(objects.values())} of them moving, "
        f"visible {visible:,} times, content {table.digest[:12]}"
    )
    tell(report)
