"""The command line. Everything heavy is imported after the arguments are parsed."""

import os
import sys
import textwrap
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING

import click

from genie_sim.base import plugins
from genie_sim.base.errors import UserError, unknown
from genie_sim.base.paths import expanded
from genie_sim.base.text import one_line
from genie_sim.cli import arguments, completion, terminal
from genie_sim.cli.arguments import (
    COUNT,
    PATH,
    accept_option,
    backend_option,
    changed_option,
    jobs_option,
    label_option,
    own_code_option,
    scheduler_option,
    seeds_option,
)
from genie_sim.cli.compare import compare, figures, table
from genie_sim.cli.imports import import_tables
from genie_sim.cli.links import import_link
from genie_sim.cli.perceive import perceive, truth
from genie_sim.cli.ros import ros
from genie_sim.cli.search import search
from genie_sim.cli.shipped import show
from genie_sim.cli.terminal import Commands, ProgressBar
from genie_sim.version import VERSION

if TYPE_CHECKING:
    from genie_sim.analysis.seed_runs import SeedRuns
    from genie_sim.record.results import Run
    from genie_sim.report.output import Output
    from genie_sim.scenario.scenario import Scenario
    from genie_sim.study.study import Study
    from genie_sim.study.tasks import DaskWorkers, LocalWorkers

EXAMPLES = """\b
genie-sim run 3car_hetero
genie-sim run 3car_hetero --set cars[0].device=orin_nano --seed 7
genie-sim reproduce --quick

Simulates Genie, the smart ROS cache for connected vehicles and edge servers.
"""


@click.group(
    cls=Commands,
    help=EXAMPLES,
    invoke_without_command=True,
    context_settings={"show_default": True},
)
@click.version_option(
    VERSION,
    message="genie-sim %(version)s",
    help="Print the version and exit.",
)
@click.option(
    "--debug/--no-debug", expose_value=False, help="Show where a class of your own failed."
)
@click.pass_context
def app(context: click.Context) -> None:
    if context.invoked_subcommand is None:
        click.echo(terminal.welcome(terminal.width()))


@app.command()
@click.argument(
    "scenario",
    help="A scenario file, or the name of one that comes with genie-sim.",
    shell_complete=completion.scenarios,
)
@click.option(
    "--set",
    "set_",
    multiple=True,
    metavar="PATH=VALUE",
    shell_complete=completion.setting_paths,
    help="Change a field, such as cars[0].device=orin_nano. Repeatable.",
)
@click.option(
    "--seed",
    type=click.IntRange(min=0),
    help="Root of all random streams; default: the scenario's.",
)
@click.option(
    "--methods",
    metavar="A,B,...",
    shell_complete=completion.methods,
    help="Only these: methods of the scenario, of 'list methods', or module:Class.",
)
@seeds_option
@click.option("--jobs", type=COUNT, help="With --seeds: processes; default: one a core.")
@click.option(
    "--workers",
    type=COUNT,
    help="Processes for one run, whose methods are simulated side by side. Default: 1.",
)
@label_option
@click.option("--out", type=PATH, default="results", help="The folder that gets the result folder.")
@click.option("--no-report", is_flag=True, help="Leave out report.html.")
@click.option("--figures", is_flag=True, help="Draw the figures as well, as SVG.")
@click.option("--all", "all_rows", is_flag=True, help="Print all rows of the table.")
@arguments.metrics_option
def run(
    *,
    scenario: str,
    set_: tuple[str, ...],
    seed: int | None,
    methods: str | None,
    seeds: str | None,
    jobs: int | None,
    workers: int | None,
    label: str,
    out: Path,
    no_report: bool,
    figures: bool,
    all_rows: bool,
    metrics: str | None,
) -> None:
    """Simulate a scenario under each of its methods.

    Those are local, remote and Genie, unless it says otherwise.

    \b
    genie-sim run 3car_hetero
    genie-sim run 3car_hetero --set cars[0].device=orin_nano --set genie.eviction=lru
    genie-sim run mine.yaml --seed 7 --out lab
    genie-sim run mine.yaml --methods local,genie
    genie-sim run 3car_hetero --seeds 5
    """
    from genie_sim.base import files

    several = arguments.seeds(seeds)
    if seed is not None and several is not None:
        raise UserError("--seed and --seeds: give one of them")
    if jobs is not None and several is None:
        raise UserError("--jobs: goes with --seeds; for one run give --workers")
    if workers is not None and several is not None:
        raise UserError("--workers: is for one run; with --seeds give --jobs")
    rows = arguments.listed("--metrics", metrics) if metrics is not None or all_rows else None
    if rows and all_rows:
        raise UserError("--all and --metrics: give one of them")

    files.find(files.SCENARIO, scenario)  # a wrong name is reported before the heavy imports
    from genie_sim.scenario.reading import load_scenario

    names = arguments.listed("--methods", methods)
    loaded = load_scenario(scenario, set_, seed, methods=names, methods_from=f"--methods {methods}")
    if rows:
        from genie_sim.analysis import registry

        registry.checked(rows, loaded.metrics)
    from genie_sim.record.results import checked_label
    from genie_sim.report.output import Output
    from genie_sim.runs import prepare
    from genie_sim.runs.folder import run_to_folder

    label = checked_label(label, "--label")
    if own := prepare.plugin_names(loaded):
        click.echo(f"{loaded.name} runs code of its own: {', '.join(own)}")
    for note in prepare.notes(loaded):
        click.echo(textwrap.fill(note, min(terminal.width(), 100)))
    output = Output(not no_report, ("svg",) if figures else ())
    if several is not None:
        return _run_seeds(loaded, several, out, jobs=jobs, label=label, output=output, rows=rows)
    with ProgressBar() as progress:
        result = run_to_folder(loaded, out, progress, output, label=label, workers=workers or 1)
    _show(result, output, rows)


def _run_seeds(
    scenario: "Scenario",
    seeds: int | list[int],
    out: Path,
    *,
    jobs: int | None,
    label: str,
    output: "Output",
    rows: list[str] | None,
) -> None:
    """Runs a scenario under several seeds, or what is missing of that, and shows the means."""
    from genie_sim.analysis.seed_runs import load
    from genie_sim.base import parallel
    from genie_sim.study.seeds import design_of
    from genie_sim.study.study import Study
    from genie_sim.study.tasks import LocalWorkers

    design = design_of(scenario, seeds)
    work = Study.of(design, scenario.name, out, base=scenario, label=label, reports=output.page)
    _simulate(work, LocalWorkers(jobs or parallel.workers_here()))
    status = work.finish(output)
    _show(load(status.folder), output, rows)


def _simulate(
    work: "Study", workers: "LocalWorkers | DaskWorkers", part: tuple[int, int] = (1, 1)
) -> None:
    """Runs what is missing of a study. Ctrl-C ends the program with one line; what is done is
    kept.
    """
    with ProgressBar(unit="runs") as progress, closing(workers):
        try:
            work.run(workers, part, progress)
        except KeyboardInterrupt:
            print(
                f"genie-sim: interrupted; finished runs are kept in {work.folder}", file=sys.stderr
            )
            raise SystemExit(130) from None


def _show(result: "Run | SeedRuns", output: "Output", rows: list[str] | None = None) -> None:
    """Prints the table of a run, or of several seeds, as ``screen.text`` chooses its rows, and
    where the results are.
    """
    from genie_sim.analysis import screen

    folder, columns = result.folder, min(terminal.width(), 100)
    assert folder is not None
    click.echo(screen.text(result, columns, rows), nl=False)
    if len(result.runs) > 1:
        from genie_sim.analysis.compare import compared
        from genie_sim.analysis.verdict import verdicts

        for sentence in verdicts(compared([result])):
            click.echo(textwrap.fill(one_line(sentence), columns, subsequent_indent="  "))
    if len(result.runs) > 1 and len(result.methods) > 2:
        others = ",".join(method.name for method in result.methods[1:])
        click.echo(f"Other pairs: genie-sim compare {folder} --methods {others}")
    click.echo(f"Results: {folder} (all tables, with intervals: summary.md)")
    where = folder / "figures" if output.figures else f"genie-sim figures {folder}"
    click.echo(f"Figures: {where}")
    if output.page:
        click.echo(f"Report:  {folder / terminal.PAGE}")


@app.command()
@click.argument("folder", type=PATH, help="A result folder of 'run' or 'reproduce'.")
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
    from genie_sim.analysis.seed_runs import is_seeds_folder
    from genie_sim.paper import page as evaluation
    from genie_sim.record import results
    from genie_sim.report import comparison, html_page
    from genie_sim.report.run_pictures import kitti_pictures

    path = out if out is not None else folder / terminal.PAGE
    page = None
    if (folder / "verdicts.json").is_file():
        page = evaluation.page
    elif is_seeds_folder(folder):
        page = comparison.seeds_page_of
    elif (folder / "sweep.json").is_file():
        raise UserError(f"{folder}: a sweep has figures and table.csv, but no page")
    if page is None:
        run = results.load(folder, allow_changed=allow_changed)
        frames = None
        if pictures is not None:
            frames = kitti_pictures(run, pictures, copied=copy_pictures)
        html_page.write(path, run, start_ns, frames)
    elif start_ns or pictures is not None:
        option = "--start" if start_ns else "--pictures"
        raise UserError(
            f"{option}: {folder} holds no single run; only the page of a run has a replay"
        )
    else:
        html_page.write_text(path, page(folder, allow_changed))
    click.echo(f"Report: {path}")


@app.command()
@click.option("--quick", is_flag=True, help="A coarse answer in under a minute.")
@click.option("--seeds", type=COUNT, help="How many seeds; default: those of the assumptions.")
@click.option("--jobs", type=COUNT, help="Parallel processes; default: one per core.")
@click.option(
    "--reading",
    help="One reading of the paper, or a file of your own; default: all that there are.",
)
@click.option("--out", type=PATH, default="results/reproduce", help="The folder that gets it.")
def reproduce(
    *,
    quick: bool,
    seeds: int | None,
    jobs: int | None,
    reading: str | None,
    out: Path,
) -> None:
    """Run the paper's evaluation: figures and verdicts."""
    from genie_sim.paper import verdict_table
    from genie_sim.paper.reproduce import reproduce as run_evaluation

    with ProgressBar(unit="runs") as progress:
        result = run_evaluation(
            out,
            quick=quick,
            seeds=seeds,
            workers=jobs,
            progress=progress,
            reading=reading,
        )
    click.echo(verdict_table.text(verdict_table.read_rows(result.folder), terminal.width()))
    click.echo(
        f"Results: {result.folder} ({result.wall_time_s:.0f} s)\n"
        f"Figures: {result.folder / 'figures'}"
    )
    click.echo(f"Report:  {result.folder / terminal.PAGE}")


@app.command()
@click.argument("folder", type=PATH, help="A result folder.")
@changed_option
@own_code_option
def rerun(folder: Path, allow_changed: bool) -> None:
    """Run a result folder again and compare it byte for byte."""
    from genie_sim.runs import folder as run_folder

    with ProgressBar() as progress:
        compared = run_folder.rerun(folder, progress, allow_changed=allow_changed)
    for name, same in compared.items():
        click.echo(f"{name}: {'identical' if same else 'DIFFERENT'}")
    if not all(compared.values()):
        raise UserError(f"{folder}: the run does not reproduce its own result")


for _command in (compare, figures, table, perceive):
    app.add_command(_command)


@app.group("import", cls=Commands)
def imports() -> None:
    """Read files of others: poses, detections, labels, links."""


for _command in (import_tables, import_link, truth):
    imports.add_command(_command)


@imports.command()
@click.argument(
    "what",
    metavar="{model|drive}",
    shell_complete=completion.fixed("model", "drive"),
    help="What is fetched.",
)
@click.argument("name", help="Such as yolox-nano, or 2011_09_26_drive_0005.")
@click.option(
    "--out",
    type=PATH,
    help="The folder; default: $GENIE_SIM_WEIGHTS or weights, $GENIE_SIM_KITTI or kitti.",
)
def fetch(what: str, name: str, out: Path | None) -> None:
    """Take the files of a detector or a drive from the network. No other command touches it."""
    from genie_sim.data import fetch as network

    if what not in ("model", "drive"):
        raise UserError(unknown("kind of thing to fetch", what, ("model", "drive")))
    variable, usual = {
        "model": ("GENIE_SIM_WEIGHTS", "weights"),
        "drive": ("GENIE_SIM_KITTI", "kitti"),
    }[what]
    folder = out or expanded(os.environ.get(variable) or usual)
    take = network.fetch_model if what == "model" else network.fetch_drive
    with ProgressBar(unit="bytes") as progress:
        path = take(name, folder, progress)
    click.echo(f"{path}\nTo use it from anywhere: export {variable}={folder.resolve()}")
    if what == "drive":
        click.echo(
            "KITTI is licensed CC BY-NC-SA 3.0: not for commercial use. https://www.cvlibs.net/datasets/kitti/"
        )


@app.command()
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
@click.option("--column", metavar="TITLE", help="Of that table, where several hold numbers.")
@click.option(
    "--unit",
    type=click.Choice(("s", "ms", "us", "ns")),
    help="Of that column, if its title has none; default: ms.",
)
@click.option("--mean", metavar="TIME", help="Instead: the mean latency, such as '45 ms'.")
@click.option("--sd", metavar="TIME", help="With --mean: the standard deviation; default: 0 ms.")
@click.option("--cores", type=COUNT, help="The device's; default: this machine's, or assumed.")
@click.option("--model", help="What scenarios call the model; default: the detector's name.")
@click.option(
    "--weights", type=PATH, help="The ONNX file, or its folder; default: $GENIE_SIM_WEIGHTS."
)
@click.option(
    "--runs", type=click.IntRange(min=20), default=300, help="How many pictures to measure."
)
@accept_option
def profile(
    *,
    out: Path,
    detector: str | None,
    csv: Path | None,
    column: str | None,
    unit: str | None,
    mean: str | None,
    sd: str | None,
    cores: int | None,
    model: str | None,
    weights: Path | None,
    runs: int,
    accept: bool,
) -> None:
    """Measure a detector on this machine into a device profile. Or take measured latencies.

    \b
    genie-sim profile --detector yolox_nano --out device_profiles/here.yaml
    genie-sim profile --csv runs.csv --column "latency [ms]" --cores 8 --out orin.yaml
    genie-sim profile --mean 45ms --sd 5ms --cores 8 --model yolov8 --out board.yaml
    """
    from genie_sim.base import units
    from genie_sim.base.import_report import ImportReport
    from genie_sim.scenario import device_fit

    if [detector, csv, mean].count(None) != 2:
        raise UserError(
            "profile: give either --detector, to measure here, or --csv, with latencies measured "
            "elsewhere, or --mean"
        )
    if mean is None and sd is not None:
        raise UserError("profile: --sd goes with --mean")
    if csv is None and (column, unit) != (None, None):
        raise UserError("profile: --column and --unit go with --csv")
    report = ImportReport(csv or "profile", accept)
    if mean is not None:
        if model is None:
            raise UserError("profile: --mean needs --model, the name that scenarios use")
        mean_ns = arguments.quantity("--mean", mean, units.duration_ns)
        sd_ns = 0 if sd is None else arguments.quantity("--sd", sd, units.duration_ns)
        if sd_ns > mean_ns:
            raise UserError(f"profile: --sd: {sd} must be at most --mean, {mean}")
        measured, fit = device_fit.of_summary(model, mean_ns, sd_ns)
    else:
        with ProgressBar(unit="pictures") as progress:
            if csv is not None:
                measured = device_fit.from_table(
                    csv, model or csv.stem, report, column=column, unit=unit
                )
            else:
                assert detector is not None
                measured = device_fit.measure(
                    detector, weights, runs, model=model, progress=progress
                )
        fit = device_fit.fit(measured.latencies_ns)
        device_fit.check_fit(measured, fit, report)
    device_fit.write(out, measured, fit, cores)
    click.echo(f"{out}: {measured.model}: {fit if fit.runs else measured.source}")
    terminal.tell(report)


@app.command()
@click.argument(
    "sweep",
    help="A sweep file, or the name of one that comes with genie-sim.",
    shell_complete=completion.sweeps,
)
@click.option(
    "--out", type=PATH, default="results", help="The folder that gets the sweep's folder."
)
@jobs_option
@backend_option
@scheduler_option
@click.option(
    "--shard", default="1/1", metavar="I/N", help="Only this part of the runs, for job arrays."
)
@click.option(
    "--methods",
    metavar="A,B,...",
    shell_complete=completion.methods,
    help="Only these, at every point.",
)
@click.option("--seeds", metavar="N|A,B,...", help="So many seeds, or these; default: the sweep's.")
@label_option
def sweep(
    *,
    sweep: str,
    out: Path,
    jobs: int | None,
    backend: str,
    scheduler: str | None,
    shard: str,
    methods: str | None,
    seeds: str | None,
    label: str,
) -> None:
    """Simulate a scenario along axes, with several seeds. What has been done is not done again."""
    part = arguments.shard(shard)
    names, numbers = arguments.listed("--methods", methods), arguments.seeds(seeds)
    if (backend == "dask") != (scheduler is not None):
        raise click.BadParameter("--backend dask and --scheduler ADDRESS belong together")
    from genie_sim.analysis.seed_runs import load
    from genie_sim.base import parallel
    from genie_sim.record.results import checked_label
    from genie_sim.report.output import Output
    from genie_sim.study.study import Study
    from genie_sim.study.tasks import DaskWorkers, LocalWorkers

    label = checked_label(label, "--label")
    with ProgressBar(unit="points") as progress:
        work = Study.load(sweep, out, progress, seeds=numbers, methods=names, label=label)
    workers = (
        LocalWorkers(jobs or parallel.workers_here())
        if scheduler is None
        else DaskWorkers(scheduler)
    )
    _simulate(work, workers, part)
    done = work.finish()
    if done.complete and not work.design.axes:
        _show(load(done.folder), Output())
    elif done.complete:
        click.echo(
            f"{done.points:,} points, {done.runs:,} runs\n"
            f"Table: {done.folder / 'table.csv'} (and .parquet)"
        )
        click.echo(f"Figures: {done.folder / 'figures'}")
    else:
        click.echo(
            f"{done.done:,} of {done.runs:,} runs are in {done.folder}; "
            "the last shard makes the table"
        )


for _command in (search, ros):
    app.add_command(_command)


@app.command()
@click.argument("folder", type=PATH, help="A result folder.")
@click.option(
    "--format",
    default="mcap",
    shell_complete=completion.fixed("mcap", "bag"),
    help="mcap (Foxglove, ROS 2) or bag (RViz, ROS 1).",
)
@click.option("--out", type=PATH, help="The file; default: run.mcap or run.bag in the folder.")
@changed_option
@own_code_option
def export(folder: Path, format: str, out: Path | None, allow_changed: bool) -> None:
    """Write a run as a bag, for Foxglove or RViz."""
    from genie_sim.record import results
    from genie_sim.ros import export as bags

    path = out if out is not None else folder / f"run.{format}"
    count = bags.export(results.load(folder, allow_changed=allow_changed), path, format)
    click.echo(f"{path}: {count:,} messages")


@app.command("list")
@click.argument(
    "what",
    required=False,
    shell_complete=completion.kinds,
    help="scenarios, devices, links, ...; without it: all.",
)
def list_(what: str | None) -> None:
    """Show what can be named in a scenario."""
    from genie_sim.cli import catalogue

    if what is not None and what not in catalogue.KINDS:
        raise UserError(unknown("kind of thing to list", what, catalogue.KINDS))
    for kind in [what] if what is not None else catalogue.KINDS:
        if what is None:
            click.echo(f"{kind}:")
        columns = terminal.width() if sys.stdout.isatty() else None
        for line in terminal.listing(catalogue.KINDS[kind](), "" if what else "  ", columns):
            click.echo(line)


app.add_command(show)


@plugins.own_code(allowed=True)  # whatever a command forbids, the next one finds as it was
def main(argv: list[str] | None = None) -> int:
    """Runs the command line. Exit status: 0 done, 1 the user's input or environment, 2 usage, 130
    Ctrl-C or SIGTERM.
    """
    terminal.open_closed_streams()
    # figures go to files; a window that is asked for here may not even exist
    os.environ["MPLBACKEND"] = "agg"
    try:
        status = app(args=argv, prog_name="genie-sim", standalone_mode=False)
    except SystemExit as stop:
        return _status_of(stop)
    except click.UsageError as error:
        command = "genie-sim" if error.ctx is None else error.ctx.command_path
        text = one_line(error.format_message()).rstrip(".")
        print(f"genie-sim: {text}; see {command} --help", file=sys.stderr)
        return 2
    except UserError as error:
        print(f"genie-sim: {one_line(str(error))}", file=sys.stderr)
        return 1
    except (
        OSError,
        MemoryError,
    ) as error:  # the machine's; where a file is at fault, it is named before it gets here
        terminal.drop_output()
        print(f"genie-sim: {terminal.machine_said(error)}", file=sys.stderr)
        return 1
    except Exception as error:
        if (
            "--debug" in (sys.argv if argv is None else argv)
            or (fault := plugins.own_fault(error)) is None
        ):
            raise
        print(f"genie-sim: {one_line(fault)}; genie-sim --debug shows more", file=sys.stderr)
        return 1
    return status or 0


def _status_of(stop: SystemExit) -> int:
    """The exit status. A class of the user's own that ends the program is named."""
    fault = plugins.own_fault(stop)
    if fault is None and isinstance(stop.code, int | None):
        return stop.code or 0
    print(f"genie-sim: {one_line(fault or str(stop.code))}", file=sys.stderr)
    return 1
