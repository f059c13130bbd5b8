"""The command ``genie-sim truth``. Everything heavy is imported after the arguments are parsed."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from genie_sim.arguments import path_option


def truth(
    drive: Annotated[str, typer.Option(help="The labelled drive, such as 2011_09_26/0005 or tracking/0000.")],
    trace: Annotated[str, typer.Option(help="The trace of that drive: a name or a file.")],
    kitti: Annotated[Path | None, path_option(help="KITTI's root folder; default: $GENIE_SIM_KITTI.")] = None,
    out: Annotated[
        Path | None, path_option(help="The file; default: NAME.truth.parquet beside the trace, where runs find it.")
    ] = None,
) -> None:
    """Compute what really is there on a trace's drive.

    It comes from KITTI's labels of the drive, and lets runs on the trace tell how right their answers are.
    """
    from genie_sim import files
    from genie_sim.perception import perceive, truth_table
    from genie_sim.perception.trace import read_trace

    path = files.find(files.TRACE, trace)
    table = truth_table.make_truth(perceive.kitti_folder(kitti), drive, read_trace(path))
    out = truth_table.path_beside(path) if out is None else out
    truth_table.write_truth(out, table)
    objects = {row.object: row.moving for row in table.rows}
    seen = sum(row.visible for row in table.rows)
    typer.echo(
        f"{out}: {len(objects)} objects, {sum(objects.values())} of them moving, visible {seen:,} times, "
        f"content {table.digest[:12]}"
    )
