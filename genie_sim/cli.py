"""The command line. Everything heavy is imported after the arguments are parsed."""

import os
import sys
from contextlib import closing
from pathlib import Path
from typing import Annotated

import typer

from genie_sim import __version__, arguments, plugins, terminal
from genie_sim.arguments import MethodsOption, ScenarioArgument, SeedOption, SetOption, path_argument, path_option
from genie_sim.cli_compare import compare, figures, table
from genie_sim.cli_perceive import perceive, truth
from genie_sim.cli_ros import attach, detach, keys
from genie_sim.errors import UserError, unknown
from genie_sim.paths import expanded
from genie_sim.terminal import Command, Commands, Progress

EXAMPLES = """\b
genie-sim run 3car_hetero
genie-sim run 3car_hetero --set cars[0].device=orin_nano --seed 7
genie-sim reproduce --quick

Simulates Genie, the smart ROS cache for connected vehicles and edge servers.
"""

app = typer.Typer(cls=Commands, help=EXAMPLES, rich_markup_mode=None, pretty_exceptions_enable=False)


@app.callback(invoke_without_command=True)
def _root(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Print the version and exit.")] = False,
    debug: Annotated[bool, typer.Option(help="Show where a class of your own failed.")] = False,
) -> None:
    if version:
        typer.echo(f"genie-sim {__version__}")
        raise typer.Exit()
    if context.invoked_subcommand is None:
        typer.echo(terminal.welcome(terminal.width()))


@app.command()
def run(
    scenario: ScenarioArgument,
    set_: SetOption = None,
    seed: SeedOption = None,
    methods: MethodsOption = None,
    out: Annotated[Path, path_option(help="The folder that gets the result folder.")] = Path("results"),
    no_report: Annotated[bool, typer.Option("--no-report", help="Leave out report.html.")] = False,
    figures: Annotated[bool, typer.Option("--figures", help="Draw the figures as well, as SVG.")] = False,
) -> None:
    """Simulate a scenario under each of its methods.

    Those are local, remote and Genie, unless it says otherwise.

    \b
    genie-sim run 3car_hetero
    genie-sim run 3car_hetero --set cars[0].device=orin_nano --set genie.eviction=lru
    genie-sim run mine.yaml --seed 7 --out lab
    genie-sim run mine.yaml --methods local,genie
    """
    from genie_sim import files

    files.find(files.SCENARIO, scenario)  # a slip is told before anything heavy is imported
    from genie_sim import build, runner
    from genie_sim.scenario.scenario import load_scenario, with_methods

    setting = load_scenario(scenario, set_ or (), seed)
    if methods is not None:
        setting = with_methods(setting, methods.split(","), f"--methods {methods}")
    if own := build.own_plugins(setting):
        typer.echo(f"{setting.name} runs code of its own: {', '.join(f'{what} {name}' for what, name in own)}")
    with Progress() as progress:
        result = runner.run_to_folder(setting, out, progress, not no_report, ("svg",) if figures else ())
    from genie_sim.analysis import summary

    typer.echo(summary.text(result.metrics, width=min(terminal.width(), 100)), nl=False)
    typer.echo(f"Results: {result.folder} (all tables, with intervals: summary.md)")
    typer.echo(f"Figures: {result.folder / 'figures' if figures else f'genie-sim figures {result.folder}'}")
    if not no_report:
        typer.echo(f"Report:  {result.folder / terminal.PAGE}")


@app.command()
def report(
    folder: Annotated[Path, path_argument(help="A result folder of 'run', 'reproduce' or 'sweep'.")],
    start: Annotated[str, typer.Option(help="Where the replay of a long run begins, such as '60 s'.")] = "0 s",
    out: Annotated[Path | None, path_option(help="The page to write; default: report.html in the folder.")] = None,
    allow_own_code: arguments.OwnCodeOption = False,
) -> None:
    """Write one HTML page about a run, an evaluation or a sweep."""
    from genie_sim import units

    try:
        start_ns = units.duration_ns(start)
    except ValueError as error:
        raise UserError(f"--start: {error}") from error
    path = out if out is not None else folder / terminal.PAGE
    _write_page(folder, path, start_ns)
    typer.echo(f"Report: {path}")


def _write_page(folder: Path, path: Path, start_ns: int) -> None:
    """The page about whatever a folder holds: an evaluation, a sweep or a run. Raises ``UserError``."""
    from genie_sim import report
    from genie_sim.paper import page as evaluation
    from genie_sim.recording import results
    from genie_sim.sweeps import page as sweep

    for name, write in {"verdicts.json": evaluation.write, "sweep.json": sweep.write}.items():
        if (folder / name).is_file():
            if start_ns:
                raise UserError(f"--start: {folder} holds no single run; only the page of a run has a replay")
            return write(path, folder)
    report.write(path, results.load(folder), start_ns)


@app.command()
def reproduce(
    quick: Annotated[bool, typer.Option("--quick", help="A coarse answer in under a minute.")] = False,
    seeds: Annotated[int | None, typer.Option(min=1, help="How many seeds; default: those of the assumptions.")] = None,
    jobs: Annotated[int | None, typer.Option(min=1, help="Parallel processes; default: one per core.")] = None,
    drives: Annotated[
        bool, typer.Option("--drives", help="The main claims on each of KITTI's tracking sequences, too.")
    ] = False,
    reading: Annotated[
        str | None, typer.Option(help="One reading of the paper, or a file of your own; default: all that there are.")
    ] = None,
    explore: Annotated[
        bool, typer.Option("--explore", help="Instead: the claims all over the paper's open choices. Resumable.")
    ] = False,
    out: Annotated[
        Path | None, path_option(help="The folder that gets it; default: results/reproduce or results/explore.")
    ] = None,
) -> None:
    """Run the paper's evaluation: figures and verdicts."""
    if explore:
        if quick or drives or seeds is not None or reading is not None:
            raise UserError("--explore: has a design of its own; of the others only --jobs and --out go with it")
        return _explore(out or Path("results/explore"), jobs)
    out = out or Path("results/reproduce")
    from genie_sim.paper import verdict_table
    from genie_sim.paper.reproduce import reproduce as run_evaluation

    with Progress(unit="runs") as progress:
        result = run_evaluation(out, quick, seeds, jobs, progress, drives, reading)
    typer.echo(verdict_table.text(verdict_table.read_rows(result.folder), terminal.width()))
    if result.drives:
        typer.echo(f"\n{result.drives}\n")
    typer.echo(f"Results: {result.folder} ({result.wall_time_s:.0f} s)\nFigures: {result.folder / 'figures'}")
    typer.echo(f"Report:  {result.folder / terminal.PAGE}")


def _explore(out: Path, jobs: int | None) -> None:
    from genie_sim.paper import explore
    from genie_sim.parallel import workers_here

    with Progress(unit="points") as progress:
        found = explore.explore(out, jobs or workers_here(), progress)
    typer.echo(f"{explore.text(found)}\n\nResults: {out}")


@app.command()
def rerun(
    folder: Annotated[Path, path_argument(help="A result folder.")], allow_own_code: arguments.OwnCodeOption = False
) -> None:
    """Run a result folder again and compare it byte for byte."""
    from genie_sim import runner

    with Progress() as progress:
        compared = runner.rerun(folder, progress)
    for name, same in compared.items():
        typer.echo(f"{name}: {'identical' if same else 'DIFFERENT'}")
    if not all(compared.values()):
        raise UserError(f"{folder}: the run does not reproduce its own result")


app.command()(compare)
app.command()(figures)
app.command()(table)
app.command()(perceive)
app.command()(truth)


@app.command()
def fetch(
    what: Annotated[str, typer.Argument(metavar="model|drive", help="What is fetched.")],
    name: Annotated[str, typer.Argument(help="Such as yolox-nano, or 2011_09_26_drive_0005.")],
    out: Annotated[
        Path | None, path_option(help="The folder; default: $GENIE_SIM_WEIGHTS or weights, $GENIE_SIM_KITTI or kitti.")
    ] = None,
) -> None:
    """Take the files of a detector or a drive from the network. No other command touches it."""
    from genie_sim.perception import fetch as network

    if what not in ("model", "drive"):
        raise UserError(unknown("kind of thing to fetch", what, ("model", "drive")))
    variable, usual = {"model": ("GENIE_SIM_WEIGHTS", "weights"), "drive": ("GENIE_SIM_KITTI", "kitti")}[what]
    folder = out or expanded(os.environ.get(variable) or usual)
    take = network.fetch_model if what == "model" else network.fetch_drive
    with Progress(unit="bytes") as progress:
        path = take(name, folder, progress)
    typer.echo(f"{path}\nTo use it from anywhere: export {variable}={folder.resolve()}")
    if what == "drive":
        typer.echo("KITTI is licensed CC BY-NC-SA 3.0: not for commercial use. https://www.cvlibs.net/datasets/kitti/")


@app.command()
def profile(
    out: Annotated[Path, path_option(help="The device profile to write, such as device_profiles/here.yaml.")],
    detector: Annotated[
        str | None, typer.Option(help="Measure this detector here ('list detectors', or your own module:Class).")
    ] = None,
    csv: Annotated[
        Path | None, path_option(help="Instead: latencies in milliseconds measured elsewhere, one in a line.")
    ] = None,
    model: Annotated[
        str | None, typer.Option(help="What scenarios call the model; default: the detector's name.")
    ] = None,
    weights: Annotated[
        Path | None, path_option(help="The ONNX file, or its folder; default: $GENIE_SIM_WEIGHTS.")
    ] = None,
    runs: Annotated[int, typer.Option(min=20, help="How many pictures to measure.")] = 300,
    empirical: Annotated[
        bool, typer.Option("--empirical", help="Keep the measured distribution instead of the fitted law.")
    ] = False,
) -> None:
    """Measure a detector on this machine into a device profile. Or take measured latencies."""
    from genie_sim import device_fit

    if (detector is None) == (csv is None):
        raise UserError("profile: give either --detector, to measure here, or --csv, with latencies measured elsewhere")
    with Progress(unit="pictures") as progress:
        if csv is not None:
            measured = device_fit.from_csv(csv, model or csv.stem)
        else:
            assert detector is not None
            measured = device_fit.measure(detector, weights, runs, model, progress)
    fit = device_fit.fit(measured.latencies_ns)
    device_fit.write(out, measured, fit, empirical)
    typer.echo(f"{out}: {measured.model}: {fit}")


@app.command()
def sweep(
    sweep: Annotated[str, typer.Argument(help="A sweep file, or the name of one that comes with genie-sim.")],
    out: Annotated[Path, path_option(help="The folder that gets the sweep's folder.")] = Path("results"),
    jobs: Annotated[int | None, typer.Option(min=1, help="Processes on this machine; default: one a core.")] = None,
    backend: Annotated[str, typer.Option(help="joblib (this machine) or dask (a cluster).")] = "joblib",
    scheduler: Annotated[str | None, typer.Option(help="Address of the Dask scheduler, tcp://host:8786.")] = None,
    shard: Annotated[str, typer.Option(metavar="I/N", help="Only this part of the runs, for job arrays.")] = "1/1",
) -> None:
    """Simulate a scenario along axes, with several seeds. What has been done is not done again."""
    part = arguments.shard(shard)
    if backend not in ("joblib", "dask"):
        raise typer.BadParameter(unknown("backend", backend, ("joblib", "dask")))
    if (backend == "dask") != (scheduler is not None):
        raise typer.BadParameter("--backend dask and --scheduler ADDRESS belong together")
    from genie_sim import parallel
    from genie_sim.sweeps.sweep import Sweep
    from genie_sim.sweeps.tasks import Dask, Local

    with Progress(unit="points") as progress:
        work = Sweep.load(sweep, out, progress)
    with Progress(unit="runs") as progress:
        with closing(Local(jobs or parallel.workers_here()) if scheduler is None else Dask(scheduler)) as workers:
            try:
                work.run(workers, part, progress)
            except KeyboardInterrupt:
                print(f"genie-sim: interrupted; finished runs are kept in {work.folder}", file=sys.stderr)
                raise SystemExit(130) from None
        done = work.finish()
    if done.complete:
        typer.echo(f"{done.points:,} points, {done.runs:,} runs\nTable: {done.folder / 'table.csv'} (and .parquet)")
        typer.echo(f"Figures: {done.folder / 'figures'}\nReport:  {done.folder / terminal.PAGE}")
    else:
        typer.echo(f"{done.done:,} of {done.runs:,} runs are in {done.folder}; the last shard makes the table")


app.command()(attach)
app.command()(detach)
app.add_typer(keys, name="keys")


@app.command()
def export(
    folder: Annotated[Path, path_argument(help="A result folder.")],
    format: Annotated[str, typer.Option(help="mcap (Foxglove, ROS 2) or bag (RViz, ROS 1).")] = "mcap",
    out: Annotated[Path | None, path_option(help="The file; default: run.mcap or run.bag in the folder.")] = None,
    allow_own_code: arguments.OwnCodeOption = False,
) -> None:
    """Write a run as a bag, for Foxglove or RViz."""
    from genie_sim.recording import results
    from genie_sim.ros import export as bags

    path = out if out is not None else folder / f"run.{format}"
    count = bags.export(results.load(folder), path, format)
    typer.echo(f"{path}: {count:,} messages")


@app.command("list")
def list_(
    what: Annotated[
        str | None,
        typer.Argument(help="scenarios, devices, links, ...; without it: all.", autocompletion=arguments.kinds),
    ] = None,
) -> None:
    """Show what can be named in a scenario."""
    from genie_sim import catalogue

    if what is not None and what not in catalogue.KINDS:
        raise UserError(unknown("kind of thing to list", what, catalogue.KINDS))
    for kind in [what] if what is not None else catalogue.KINDS:
        if what is None:
            typer.echo(f"{kind}:")
        columns = terminal.width() if sys.stdout.isatty() else None
        for line in terminal.listing(catalogue.KINDS[kind](), "" if what else "  ", columns):
            typer.echo(line)


@app.command()
def schema(what: Annotated[str, typer.Argument(metavar="scenario|device", help="What kind of file.")]) -> None:
    """Print the JSON Schema of scenarios or devices, for editors."""
    import json

    from genie_sim.scenario.schema import SCHEMAS, json_schema

    if what not in SCHEMAS:
        raise UserError(unknown("kind of file", what, SCHEMAS))
    typer.echo(json.dumps(json_schema(what), indent=2))


for _command in app.registered_commands:
    _command.cls = Command


def main(argv: list[str] | None = None) -> int:
    """Runs the command line. Exit status: 0 done, 1 the user's input or environment, 2 usage, 130 Ctrl-C or SIGTERM."""
    terminal.open_closed_streams()
    os.environ["MPLBACKEND"] = "agg"  # figures go to files; a window that is asked for here may not even exist
    try:
        app(args=argv, prog_name="genie-sim")
    except SystemExit as stop:
        return stop.code if isinstance(stop.code, int) else int(stop.code is not None)
    except UserError as error:
        print(f"genie-sim: {terminal.one_line(str(error))}", file=sys.stderr)
        return 1
    except (OSError, MemoryError) as error:  # the machine's; where a file is at fault, it is named before it gets here
        terminal.drop_output()
        print(f"genie-sim: {terminal.machine_said(error)}", file=sys.stderr)
        return 1
    except Exception as error:
        if "--debug" in (sys.argv if argv is None else argv) or (fault := plugins.own_fault(error)) is None:
            raise
        print(f"genie-sim: {terminal.one_line(fault)}; genie-sim --debug shows more", file=sys.stderr)
        return 1
    return 0
