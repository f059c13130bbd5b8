"""Commands about results that are there. Everything heavy is imported after the arguments are
parsed.
"""

from pathlib import Path

import click

from genie_sim.base.errors import UserError, unknown
from genie_sim.base.text import one_line
from genie_sim.cli import completion
from genie_sim.cli.arguments import PATH, changed_option, listed, metrics_option, own_code_option

WIDTHS = ("column", "page", "acm-column", "acm-page")  # of style.WIDTHS, which imports numpy
TABLE_FORMATS = completion.fixed("markdown", "csv", "latex")


@click.command()
@click.argument(
    "folders", nargs=-1, required=True, help="Result folders, the one to compare with first."
)
@click.option(
    "--methods",
    metavar="A,B,...",
    shell_complete=completion.methods,
    help="Only these; of one result, the first is compared with.",
)
@click.option("--labels", metavar="A,B,...", help="What the settings are called, in their order.")
@click.option(
    "--format",
    default="markdown",
    shell_complete=TABLE_FORMATS,
    help="Of the printed table: markdown, csv or latex.",
)
@click.option("--out", type=PATH, help="Also write a page, figures and tables into this folder.")
@changed_option
@own_code_option
def compare(
    *,
    folders: tuple[str, ...],
    methods: str | None,
    labels: str | None,
    format: str,
    out: Path | None,
    allow_changed: bool,
) -> None:
    """Compare results, frame by frame where both saw the same.

    Of one result alone, its methods are compared. Differences of results with other cars or drives
    are not paired; a line says so.
    """
    from genie_sim.analysis import compare_tables, renderers
    from genie_sim.analysis.compare import compare as compare_runs
    from genie_sim.analysis.seed_runs import load
    from genie_sim.analysis.verdict import verdicts
    from genie_sim.report import comparison

    renderers.checked(format)
    runs = [load(folder, allow_changed=allow_changed) for folder in folders]
    compared = compare_runs(runs, listed("--methods", methods), listed("--labels", labels))
    click.echo(compare_tables.text(compared, format), nl=False)
    if format == "markdown":
        click.echo()
        for sentence in verdicts(compared):
            click.echo(one_line(sentence))
        click.echo(compare_tables.about(compared))
        for path, values in compared.settings.items():
            click.echo(one_line(f"{path}: {' | '.join(values)}"))
    if out is not None:
        click.echo(f"Report: {comparison.write(compared, out)}", err=format != "markdown")


RESULTS = "Result folders: of a run, a sweep or an evaluation; several runs are compared."
FOLDERS = click.argument("folders", nargs=-1, required=True, type=PATH, help=RESULTS)


@click.command()
@FOLDERS
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


@click.command()
@FOLDERS
@click.option(
    "--format",
    default="markdown",
    shell_complete=TABLE_FORMATS,
    help="markdown, latex or csv (every metric, all digits).",
)
@click.option(
    "--methods",
    metavar="A,B,...",
    shell_complete=completion.methods,
    help="Only these; differences are from the first.",
)
@metrics_option
@changed_option
@own_code_option
def table(
    *,
    folders: tuple[Path, ...],
    format: str,
    methods: str | None,
    metrics: str | None,
    allow_changed: bool,
) -> None:
    """Print the numbers of results as a table for a paper.

    LaTeX needs the packages booktabs and siunitx.

    \b
    genie-sim table results/3car_hetero-65c23e86c242 --format latex
    """
    from genie_sim.cli import outputs

    names, rows = listed("--methods", methods), listed("--metrics", metrics)
    click.echo(outputs.table(folders, format, names, allow_changed, rows), nl=False)
