"""The command ``import link``. Everything heavy is imported after the arguments are parsed."""

from pathlib import Path

import click

from genie_sim.cli.arguments import PATH, accept_option, refuse
from genie_sim.cli.terminal import tell

DIRECTED = ("mtu", "mahimahi")
FORMATS = ("csv", "cicv5g", "mtu", "mahimahi")


@click.command("link")
@click.argument("file", type=PATH, help="A file with measurements.")
@click.option(
    "--format", type=click.Choice(FORMATS), default="csv", help="What wrote it; see the how-to."
)
@click.option("--out", type=PATH, required=True, help="The recording, such as drive.parquet.")
@click.option(
    "--direction",
    type=click.Choice(("up", "down")),
    help="Which way the rates of mtu and mahimahi lead; default: up.",
)
@click.option("--source", default="", help="Where the measurements come from; is kept in the file.")
@click.option("--licence", default="", help="Their licence; is kept in the file.")
@accept_option
def import_link(
    *,
    file: Path,
    format: str,
    out: Path,
    direction: str | None,
    source: str,
    licence: str,
    accept: bool,
) -> None:
    """Turn measurements of a link into a recording.

    \b
    genie-sim import link drive.csv --out drive.parquet
    genie-sim import link Data5G.csv --format mtu --out cork.parquet
    """
    from genie_sim.base.import_report import ImportReport
    from genie_sim.base.paths import sha256_of
    from genie_sim.data.link_import import IMPORTERS
    from genie_sim.links import recording

    if format not in DIRECTED:
        refuse(f"with --format {format}", "direction")
    report = ImportReport(file, accept)
    columns = IMPORTERS[format](file, direction or "up", report)  # type: ignore[arg-type]
    recording.check(str(file), columns)
    recording.tell(report, columns)
    about = {
        "format": format,
        "file": file.name,
        "sha256": sha256_of(file),
        "import": report.facts(),
        "source": source,
        "licence": licence,
    }
    recording.write(out, columns, about)
    t_ns = columns["t_ns"]
    names = ", ".join(name for name in columns if name != "t_ns")
    click.echo(f"{out}: {len(t_ns):,} rows, {(t_ns[-1] - t_ns[0]) / 1e9:,.1f} s: {names}")
    tell(report)
