"""The command ``profile``. Everything heavy is imported after the arguments are parsed."""

from pathlib import Path

import click

from genie_sim.base.errors import UserError
from genie_sim.base.plugins import allow_own_code
from genie_sim.cli import arguments, terminal
from genie_sim.cli.arguments import COUNT, PATH
from genie_sim.cli.terminal import ProgressBar


@click.command()
@click.option(
    "--out",
    type=PATH,
    required=True,
    help="The device profile to write, such as device_profiles/here.yaml.",
)
@click.option(
    "--detector", help="Measure this detector here ('list detectors', or your own module:Class)."
)
@click.option(
    "--csv",
    type=PATH,
    help="Instead: latencies measured elsewhere: a table (CSV, Parquet).",
)
@click.option(
    "--column", metavar="TITLE", help="Of that table; default: the one that says latency."
)
@click.option(
    "--unit",
    type=click.Choice(("s", "ms", "us", "ns")),
    help="Of that column, if its title has none.",
)
@click.option("--cores", type=COUNT, help="The device's; default: this machine's, or assumed.")
@click.option("--model", help="What scenarios call the model; default: the detector's name.")
@click.option(
    "--weights", type=PATH, help="The ONNX file, or its folder; default: $GENIE_SIM_WEIGHTS."
)
@click.option(
    "--runs", type=click.IntRange(min=20), default=300, help="How many pictures to measure."
)
def profile(
    *,
    out: Path,
    detector: str | None,
    csv: Path | None,
    column: str | None,
    unit: str | None,
    cores: int | None,
    model: str | None,
    weights: Path | None,
    runs: int,
) -> None:
    """Measure a detector on this machine into a device profile. Or take measured latencies.

    \b
    genie-sim profile --detector yolox_nano --model autoware_vision_detector --out here.yaml
    genie-sim profile --csv runs.csv --column "latency [ms]" --cores 8 --out orin.yaml
    """
    from genie_sim.base.import_report import ImportReport
    from genie_sim.scenario import device_fit

    allow_own_code()
    if (detector is None) == (csv is None):
        raise UserError(
            "profile: give either --detector, to measure here, or --csv, with latencies measured "
            "elsewhere"
        )
    if csv is None:
        arguments.refuse("with --detector", "column", "unit")
    else:
        arguments.refuse("with --csv", "weights", "runs")
    usual_model = "detector" if csv is None else csv.stem
    device_fit.check(out, model or usual_model, cores)  # before anything is measured
    report = ImportReport(csv or "profile")
    with ProgressBar(unit="pictures") as progress:
        if csv is not None:
            measured = device_fit.from_table(csv, model or csv.stem, report, column, unit)
        else:
            assert detector is not None
            measured = device_fit.measure(detector, weights, runs, model, progress)
    fit = device_fit.fit(measured.latencies_ns)
    device_fit.check_fit(measured, fit, report)
    device_fit.write(out, measured, fit, cores)
    click.echo(f"{out}: {measured.model}: {fit}")
    terminal.tell(report)
