"""The command ``figures``. Everything heavy is imported after the arguments are parsed."""

from pathlib import Path

import click

from genie_sim.base.errors import UserError, unknown
from genie_sim.cli import completion
from genie_sim.cli.arguments import PATH, changed_option, own_code_option, results_argument

WIDTHS = ("column", "page", "acm-column", "acm-page")  # of style.WIDTHS, which imports numpy


@click.command()
@results_argument
@click.option(
    "--format",
    default="svg",
    metavar="A,B,...",
    shell_complete=completion.fixed("svg", "png", "pdf"),
    help="svg, png, pdf, or several.",
)
@click.option(
    "--width",
    shell_complete=completion.fixed(*WIDTHS),
    help="Of a printed 'column' (3.5 in) or 'page' (7.16 in) of IEEE, or 'acm-column' (3.33 in) or"
    " 'acm-page' (7 in); default: what fits each.",
)
@click.option("--out", type=PATH, help="Where to; default: figures in the first result folder.")
@changed_option
@own_code_option
def figures(
    *,
    folders: tuple[Path, ...],
    format: str,
    width: str | None,
    out: Path | None,
    allow_changed: bool,
) -> None:
    """Draw the figures of results for a paper.

    A title, and which run it is, stand in the file and not in the picture. PDF has its fonts
    embedded.

    \b
    genie-sim figures results/3car_hetero-65c23e86c242 --format svg,pdf
    """
    from genie_sim.analysis.figures import FORMATS, save_all
    from genie_sim.cli import outputs
    from genie_sim.record import provenance

    formats = list(dict.fromkeys(format.split(",")))
    for name in formats:
        if name not in FORMATS:
            raise UserError(f"--format: {unknown('format', name, FORMATS)}")
    if width not in (None, *WIDTHS):
        raise UserError(f"--width: {unknown('width', str(width), WIDTHS)}")
    drawn = outputs.figures(folders, width, allow_changed)
    if out is None and len(folders) > 1:
        raise UserError("figures: of several results: say where to, with --out")
    target = provenance.contained(folders[0], "figures") if out is None else out
    click.echo("\n".join(map(str, save_all(drawn, target, formats))))
