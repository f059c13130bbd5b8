"""Where the time of ``genie-sim run SCENARIO`` goes: CPU seconds of its stages, in a fresh process.

python benchmarks/main_job.py [SCENARIO] [--set PATH=VALUE]
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path


def measured(scenario: str, settings: list[str]) -> dict[str, float]:
    """The stages of one run in this process, which has imported nothing yet [s]; ``all but
    figures`` is their sum.
    """
    took: dict[str, float] = {}
    before = 0.0  # the interpreter's own start is part of the first stage

    def done(stage: str) -> None:
        nonlocal before
        now = time.process_time()
        took[stage], before = now - before, now

    from genie_sim import cli, report, runner  # noqa: F401 - the command line is a part of it
    from genie_sim.analysis import screen, summary
    from genie_sim.scenario.scenario import load_scenario

    done("imports")
    prepared = runner.prepare(load_scenario(scenario, settings))
    done("reading")
    with tempfile.TemporaryDirectory() as folder:
        tables = runner.simulate(prepared, spill=Path(folder))
        done("simulating")
        for name, table in tables.items():
            table.write(Path(folder) / f"{name}.parquet")
        done("Parquet")
        made = runner.finished(prepared, "0" * 12, tables)
        done("numbers")
        summary.markdown(made)
        screen.text(made)
        done("summary")
        report.write(Path(folder) / report.NAME, made)
        done("page")
        took["all but figures"] = sum(took.values())
        from genie_sim.analysis import figures

        figures.write(made, Path(folder) / "figures", ("svg",))
        done("figures (on demand)")
    return took


def in_a_fresh_process(scenario: str, settings: list[str]) -> dict[str, float]:
    """The same, with every import paid for."""
    told = [part for setting in settings for part in ("--set", setting)]
    command = [sys.executable, __file__, scenario, "--here", *told]
    found: dict[str, float] = json.loads(
        subprocess.run(command, check=True, capture_output=True, text=True).stdout
    )
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenario", nargs="?", default="3car_hetero")
    parser.add_argument("--set", action="append", default=[], metavar="PATH=VALUE")
    parser.add_argument("--runs", type=int, default=3, help="the fastest of each stage counts")
    parser.add_argument("--here", action="store_true", help="once, as JSON")
    given = parser.parse_args()
    if given.here:
        print(json.dumps(measured(given.scenario, given.set)))
        return
    runs = [in_a_fresh_process(given.scenario, given.set) for _ in range(given.runs)]
    for stage in runs[0]:
        print(f"{stage:20} {min(run[stage] for run in runs):6.2f} s")


if __name__ == "__main__":
    main()
