"""The command ``figures``. Everything heavy is imported after the arguments are parsed."""

from pathlib import Path

import click

from genie_sim.base.errors import UserError, unknown
from genie_sim.cli import arguments
from genie_sim.cli.arguments import (
    PATH,
    labels_option,
    listed,
    own_code_option,
    results_argument,
    shown_methods_option,
)


@click.command()
@results_argument
@click.option(
    "--only",
    metavar="NAME",
    help="Draw this one alone: a figure, such as latency_cdf, or a metric of 'list metrics', of a"
    " sweep along its axes. The results need not have seen the same frames.",
)
@shown_methods_option
@labels_option
@click.option(
    "--format",
    metavar="A,B,...",
    help="svg, png, pdf, or several; default: svg, or as --out ends.",
)
@click.option(
    "--width",
    metavar="NAME|INCHES",
    help="Of a printed 'column' (252 pt) or 'page' (516 pt) of IEEEtran, or 'acm-column' (3.33 in)"
    " or 'acm-page' (7 in), or in inches; default: what fits each.",
)
@click.option(
    "--out",
    type=PATH,
    help="The folder, or with --only the file, such as f.pdf; default: figures in the first result"
    " folder.",
)
@own_code_option
def figures(
    *,
    folders: tuple[Path, ...],
    only: str | None,
    methods: str | None,
    labels: tuple[str, ...],
    format: str | None,
    width: str | None,
    out: Path | None,
) -> None:
    """Draw the figures of results for a paper, or one of them.

    A title, and which run it is, stand in the file and not in the picture. PDF has its fonts
    embedded.

    \b
    genie-sim figures results/3car_hetero-65c23e86c242 --format svg,pdf
    genie-sim figures results/wifi results/lte --only latency_cdf --methods genie --out cdf.pdf
    """
    from genie_sim import kinds
    from genie_sim.analysis.figures import FORMATS, save_all
    from genie_sim.record import provenance

    width_in = arguments.width_in(width)
    formats, name = listed("--format", format) or ["svg"], only
    is_file = only is not None and out is not None and out.suffix != ""
    if is_file and out is not None:
        if format is not None and {*formats} != {out.suffix[1:]}:
            raise UserError(f"--format: {out} says another; leave one of them out")
        formats, name = [out.suffix[1:]], out.stem
    for one in formats:
        if one not in FORMATS:
            raise UserError(
                f"{'--out' if is_file else '--format'}: {unknown('format', one, FORMATS)}"
            )
    if out is None and len(folders) > 1:
        raise UserError("figures: of several results: say where to, with --out")
    result = kinds.shown(folders, listed("--methods", methods), labels)
    if only is None or name is None:
        drawn = result.figures(width_in)
    else:
        drawn = {name: result.figure(only, width_in)}
    if out is None:
        out = provenance.contained(folders[0], "figures")
    paths = save_all(drawn, out.parent if is_file else out, list(dict.fromkeys(formats)))
    click.echo("\n".join(map(str, paths)))
