"""The command ``report``. Everything heavy is imported after the arguments are parsed."""

from pathlib import Path

import click

from genie_sim.base.errors import UserError
from genie_sim.cli.arguments import PATH, changed_option, own_code_option


@click.command()
@click.argument("folder", type=PATH, help="A result folder of any kind.")
@click.option(
    "--start", default="0 s", help="Where the replay of a long run begins, such as '60 s'."
)
@click.option("--out", type=PATH, help="The page to write; default: report.html in the folder.")
@click.option(
    "--pictures",
    metavar="DIR",
    type=PATH,
    help="KITTI's folder: the replay shows its frames, which stay where they are.",
)
@click.option("--copy-pictures", is_flag=True, help="The page holds small copies of the frames.")
@changed_option
@own_code_option
def report(
    *,
    folder: Path,
    start: str,
    out: Path | None,
    pictures: Path | None,
    copy_pictures: bool,
    allow_changed: bool,
) -> None:
    """Write one HTML page about the results in a folder."""
    from genie_sim.base import units

    try:
        start_ns = units.duration_ns(start)
    except ValueError as error:
        raise UserError(f"--start: {error}") from error
    if copy_pictures and pictures is None:
        raise UserError("--copy-pictures: --pictures says where they are")
    from genie_sim import kinds
    from genie_sim.report import html_page
    from genie_sim.report.run_pictures import kitti_pictures

    result = kinds.load(folder, allow_changed=allow_changed)
    if isinstance(result, kinds.Run):
        frames = None
        if pictures is not None:
            frames = kitti_pictures(result, pictures, copied=copy_pictures)
        page = result.page(start_ns, frames)
    elif start_ns or pictures is not None:
        option = "--start" if start_ns else "--pictures"
        raise UserError(
            f"{option}: {folder} holds no single run; only the page of a run has a replay"
        )
    else:
        page = result.page()
    path = out if out is not None else folder / html_page.NAME
    html_page.write_text(path, page)
    click.echo(f"Report: {path}")
