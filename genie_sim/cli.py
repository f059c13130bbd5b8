"""The command line. Everything heavy is imported after the arguments are parsed."""

import os
import sys
from contextlib import closing
from pathlib import Path

import click

from genie_sim import __version__, arguments, completion, plugins, terminal
from genie_sim.arguments import COUNT, PATH, own_code_option
from genie_sim.cli_compare import compare, figures, table
from genie_sim.cli_perceive import perceive, truth
from genie_sim.cli_ros import attach, detach, keys
from genie_sim.errors import UserError, unknown
from genie_sim.paths import expanded
from genie_sim.terminal import Commands, Progress

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
    __version__, message="genie-sim %(version)s", help="Print the version and exit."
)
@click.option(
    "--debug/--no-debug", expose_value=False, help="Show where a class of your own failed."
)
@completion.install_option
@completion.show_option
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
@click.option("--out", type=PATH, default="results", help="The folder that gets the result folder.")
@click.option("--no-report", is_flag=True, help="Leave out report.html.")
@click.option("--figures", is_flag=True, help="Draw the figures as well, as SVG.")
def run(
    scenario: str, set_: tuple[str, ...], seed: int | None, methods: str | None, out: Path, no_report: bool,
    figures: bool,
) -> None:  # fmt: skip
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
    from genie_sim.scenario.scenario import load_scenario, with_methods

    setting = load_scenario(scenario, set_, seed)
    if methods is not None:
        setting = with_methods(setting, methods.split(","), f"--methods {methods}")
    from genie_sim import build, runner

    if own := build.own_plugins(setting):
        click.echo(
            f"{setting.name} runs code of its own: {', '.join(f'{what} {name}' for what, name in own)}"
        )
    with Progress() as progress:
        result = runner.run_to_folder(
            setting, out, progress, not no_report, ("svg",) if figures else ()
        )
    assert result.folder is not None
    from genie_sim.analysis import summary

    click.echo(summary.text(result.measured, width=min(terminal.width(), 100)), nl=False)
    click.echo(f"Results: {result.folder} (all tables, with intervals: summary.md)")
    click.echo(
        f"Figures: {result.folder / 'figures' if figures else f'genie-sim figures {result.folder}'}"
    )
    if not no_report:
        click.echo(f"Report:  {result.folder / terminal.PAGE}")


@app.command()
@click.argument("folder", type=PATH, help="A result folder of 'run', 'reproduce' or 'sweep'.")
@click.option(
    "--start", default="0 s", help="Where the replay of a long run begins, such as '60 s'."
)
@click.option("--out", type=PATH, help="The page to write; default: report.html in the folder.")
@own_code_option
def report(folder: Path, start: str, out: Path | None) -> None:
    """Write one HTML page about a run, an evaluation or a sweep."""
    from genie_sim import units

    try:
        start_ns = units.duration_ns(start)
    except ValueError as error:
        raise UserError(f"--start: {error}") from error
    from genie_sim import report as reports
    from genie_sim.paper import page as evaluation
    from genie_sim.recording import results
    from genie_sim.sweeps import page as sweep

    path = out if out is not None else folder / terminal.PAGE
    pages = {"verdicts.json": evaluation.page, "sweep.json": sweep.page}
    page = next((page for name, page in pages.items() if (folder / name).is_file()), None)
    if page is None:
        reports.write(path, results.load(folder), start_ns)
    elif start_ns:
        raise UserError(
            f"--start: {folder} holds no single run; only the page of a run has a replay"
        )
    else:
        reports.write_text(path, page(folder))
    click.echo(f"Report: {path}")


@app.command()
@click.option("--quick", is_flag=True, help="A coarse answer in under a minute.")
@click.option("--seeds", type=COUNT, help="How many seeds; default: those of the assumptions.")
@click.option("--jobs", type=COUNT, help="Parallel processes; default: one per core.")
@click.option(
    "--drives", is_flag=True, help="The main claims on each of KITTI's tracking sequences, too."
)
@click.option(
    "--reading",
    help="One reading of the paper, or a file of your own; default: all that there are.",
)
@click.option(
    "--explore",
    is_flag=True,
    help="Instead: the claims all over the paper's open choices. Resumable.",
)
@click.option(
    "--out",
    type=PATH,
    help="The folder that gets it; default: results/reproduce or results/explore.",
)
def reproduce(
    quick: bool, seeds: int | None, jobs: int | None, drives: bool, reading: str | None, explore: bool,
    out: Path | None,
) -> None:  # fmt: skip
    """Run the paper's evaluation: figures and verdicts."""
    if explore:
        if quick or drives or seeds is not None or reading is not None:
            raise UserError(
                "--explore: has a design of its own; of the others only --jobs and --out go with it"
            )
        return _explore(out or Path("results/explore"), jobs)
    out = out or Path("results/reproduce")
    from genie_sim.paper import verdict_table
    from genie_sim.paper.reproduce import reproduce as run_evaluation

    with Progress(unit="runs") as progress:
        result = run_evaluation(out, quick, seeds, jobs, progress, drives, reading)
    click.echo(verdict_table.text(verdict_table.read_rows(result.folder), terminal.width()))
    if result.drives:
        click.echo(f"\n{result.drives}\n")
    click.echo(
        f"Results: {result.folder} ({result.wall_time_s:.0f} s)\nFigures: {result.folder / 'figures'}"
    )
    click.echo(f"Report:  {result.folder / terminal.PAGE}")


def _explore(out: Path, jobs: int | None) -> None:
    from genie_sim.paper import explore
    from genie_sim.parallel import workers_here

    with Progress(unit="points") as progress:
        found = explore.explore(out, jobs or workers_here(), progress)
    click.echo(f"{explore.text(found)}\n\nResults: {out}")


@app.command()
@click.argument("folder", type=PATH, help="A result folder.")
@own_code_option
def rerun(folder: Path) -> None:
    """Run a result folder again and compare it byte for byte."""
    from genie_sim import runner

    with Progress() as progress:
        compared = runner.rerun(folder, progress)
    for name, same in compared.items():
        click.echo(f"{name}: {'identical' if same else 'DIFFERENT'}")
    if not all(compared.values()):
        raise UserError(f"{folder}: the run does not reproduce its own result")


for _command in (compare, figures, table, perceive, truth):
    app.add_command(_command)


@app.command()
@click.argument("what", metavar="{model|drive}", help="What is fetched.")
@click.argument("name", help="Such as yolox-nano, or 2011_09_26_drive_0005.")
@click.option(
    "--out",
    type=PATH,
    help="The folder; default: $GENIE_SIM_WEIGHTS or weights, $GENIE_SIM_KITTI or kitti.",
)
def fetch(what: str, name: str, out: Path | None) -> None:
    """Take the files of a detector or a drive from the network. No other command touches it."""
    from genie_sim.perception import fetch as network

    if what not in ("model", "drive"):
        raise UserError(unknown("kind of thing to fetch", what, ("model", "drive")))
    variable, usual = {
        "model": ("GENIE_SIM_WEIGHTS", "weights"),
        "drive": ("GENIE_SIM_KITTI", "kitti"),
    }[what]
    folder = out or expanded(os.environ.get(variable) or usual)
    take = network.fetch_model if what == "model" else network.fetch_drive
    with Progress(unit="bytes") as progress:
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
    "--csv", type=PATH, help="Instead: latencies in milliseconds measured elsewhere, one in a line."
)
@click.option("--model", help="What scenarios call the model; default: the detector's name.")
@click.option(
    "--weights", type=PATH, help="The ONNX file, or its folder; default: $GENIE_SIM_WEIGHTS."
)
@click.option(
    "--runs", type=click.IntRange(min=20), default=300, help="How many pictures to measure."
)
@click.option(
    "--empirical", is_flag=True, help="Keep the measured distribution instead of the fitted law."
)
def profile(
    out: Path, detector: str | None, csv: Path | None, model: str | None, weights: Path | None, runs: int,
    empirical: bool,
) -> None:  # fmt: skip
    """Measure a detector on this machine into a device profile. Or take measured latencies."""
    from genie_sim import device_fit

    if (detector is None) == (csv is None):
        raise UserError(
            "profile: give either --detector, to measure here, or --csv, with latencies measured elsewhere"
        )
    with Progress(unit="pictures") as progress:
        if csv is not None:
            measured = device_fit.from_csv(csv, model or csv.stem)
        else:
            assert detector is not None
            measured = device_fit.measure(detector, weights, runs, model, progress)
    fit = device_fit.fit(measured.latencies_ns)
    device_fit.write(out, measured, fit, empirical)
    click.echo(f"{out}: {measured.model}: {fit}")


@app.command()
@click.argument("sweep", help="A sweep file, or the name of one that comes with genie-sim.")
@click.option(
    "--out", type=PATH, default="results", help="The folder that gets the sweep's folder."
)
@click.option("--jobs", type=COUNT, help="Processes on this machine; default: one a core.")
@click.option(
    "--backend",
    type=click.Choice(("joblib", "dask")),
    default="joblib",
    help="This machine, or a cluster.",
)
@click.option("--scheduler", help="Address of the Dask scheduler, tcp://host:8786.")
@click.option(
    "--shard", default="1/1", metavar="I/N", help="Only this part of the runs, for job arrays."
)
def sweep(
    sweep: str, out: Path, jobs: int | None, backend: str, scheduler: str | None, shard: str
) -> None:
    """Simulate a scenario along axes, with several seeds. What has been done is not done again."""
    part = arguments.shard(shard)
    if (backend == "dask") != (scheduler is not None):
        raise click.BadParameter("--backend dask and --scheduler ADDRESS belong together")
    from genie_sim import parallel
    from genie_sim.sweeps.sweep import Sweep
    from genie_sim.sweeps.tasks import Dask, Local

    with Progress(unit="points") as progress:
        work = Sweep.load(sweep, out, progress)
    with Progress(unit="runs") as progress:
        with closing(
            Local(jobs or parallel.workers_here()) if scheduler is None else Dask(scheduler)
        ) as workers:
            try:
                work.run(workers, part, progress)
            except KeyboardInterrupt:
                print(
                    f"genie-sim: interrupted; finished runs are kept in {work.folder}",
                    file=sys.stderr,
                )
                raise SystemExit(130) from None
        done = work.finish()
    if done.complete:
        click.echo(
            f"{done.points:,} points, {done.runs:,} runs\nTable: {done.folder / 'table.csv'} (and .parquet)"
        )
        click.echo(f"Figures: {done.folder / 'figures'}\nReport:  {done.folder / terminal.PAGE}")
    else:
        click.echo(
            f"{done.done:,} of {done.runs:,} runs are in {done.folder}; the last shard makes the table"
        )


for _command in (attach, detach, keys):
    app.add_command(_command)


@app.command()
@click.argument("folder", type=PATH, help="A result folder.")
@click.option("--format", default="mcap", help="mcap (Foxglove, ROS 2) or bag (RViz, ROS 1).")
@click.option("--out", type=PATH, help="The file; default: run.mcap or run.bag in the folder.")
@own_code_option
def export(folder: Path, format: str, out: Path | None) -> None:
    """Write a run as a bag, for Foxglove or RViz."""
    from genie_sim.recording import results
    from genie_sim.ros import export as bags

    path = out if out is not None else folder / f"run.{format}"
    count = bags.export(results.load(folder), path, format)
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
    from genie_sim import catalogue

    if what is not None and what not in catalogue.KINDS:
        raise UserError(unknown("kind of thing to list", what, catalogue.KINDS))
    for kind in [what] if what is not None else catalogue.KINDS:
        if what is None:
            click.echo(f"{kind}:")
        columns = terminal.width() if sys.stdout.isatty() else None
        for line in terminal.listing(catalogue.KINDS[kind](), "" if what else "  ", columns):
            click.echo(line)


@app.command()
@click.argument("what", metavar="{scenario|device}", help="What kind of file.")
def schema(what: str) -> None:
    """Print the JSON Schema of scenarios or devices, for editors."""
    import json

    from genie_sim.scenario.schema import SCHEMAS, json_schema

    if what not in SCHEMAS:
        raise UserError(unknown("kind of file", what, SCHEMAS))
    click.echo(json.dumps(json_schema(what), indent=2))


@plugins.own_code(allowed=True)  # whatever a command forbids, the next one finds as it was
def main(argv: list[str] | None = None) -> int:
    """Runs the command line. Exit status: 0 done, 1 the user's input or environment, 2 usage, 130 Ctrl-C or SIGTERM."""
    terminal.open_closed_streams()
    os.environ["MPLBACKEND"] = (
        "agg"  # figures go to files; a window that is asked for here may not even exist
    )
    try:
        app(args=argv, prog_name="genie-sim")
    except SystemExit as stop:
        return stop.code if isinstance(stop.code, int) else int(stop.code is not None)
    except UserError as error:
        print(f"genie-sim: {terminal.one_line(str(error))}", file=sys.stderr)
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
        print(
            f"genie-sim: {terminal.one_line(fault)}; genie-sim --debug shows more", file=sys.stderr
        )
        return 1
    return 0
