"""The pages of the reference that are made with the site (``tools/reference/site.py``)."""

from __future__ import annotations

import inspect
import re
from collections import Counter
from collections.abc import Iterable, Iterator
from unittest import mock

import click
from click.testing import CliRunner

from genie_sim import extend
from genie_sim.analysis import registry
from genie_sim.base import add_ons
from genie_sim.cli.main import app
from genie_sim.record import records
from genie_sim.record.tables import Column
from tools.reference.settings import settings

CLI = """\
Exit status: 0, done; 1, an error in the input or the environment, reported in one line; 2, the
command line was not understood; 130, interrupted. A traceback is a bug in genie-sim.

A long command shows its progress: a bar on a terminal, elsewhere a line on stderr every ten
seconds. `GENIE_SIM_PROGRESS=off` in the environment turns both off.
"""
SETTINGS = """\
[Write a scenario](../how-to/scenario.md) shows how to begin. On the command line a setting is
`--set PATH=VALUE`; entries of lists count from 0: `--set cars[0].link.loss=0.01`. Quantities
carry units: `30 ms`, `1.4 MB` (10^6 bytes), `4 MiB`, `100 Mbit/s`, `50 cm`, `15 deg`. A name in
brackets, as in `genie.similarity.cell[pose_grid]`, is not written in a scenario: the setting
belongs to that choice of the setting above it.
"""
API = ("run", "run_seeds", "sweep", "load", "compare", "reproduce", "load_scenario")
API += ("Run", "Runs", "Comparison")
PYTHON = """\
[Python](api.md) shows how to use these, [Extend it](../extend/method.md) how to add to them.
"""

NULL = "A column holds measurements. Null means unknown or never, not zero.\n"
METRIC = """\
The name is that in `metrics.json`; shares are from 0 to 1 there. ↑: more is
[better](../how-to/compare.md); ↓: less is. [Add a metric](../extend/metric.md).
"""
BETTER = {"higher": " ↑", "lower": " ↓", "": ""}

Lines = Iterator[str]


def texts() -> dict[str, str]:
    """The pages below docs by their path."""
    pages = {
        "cli": _page("Command line", CLI, commands()),
        "scenario": _page("Settings of a scenario", SETTINGS, settings()),
        "metrics": _page("Metrics", METRIC, metrics()),
        "tables": _page("Tables", NULL, tables()),
        "python": _page("Python: all functions and classes", PYTHON, own_code()),
    }
    return {f"reference/{name}.md": text for name, text in pages.items()}


def _page(title: str, intro: str, lines: Iterable[str]) -> str:
    return f"# {title}\n\n{intro}\n{_text(lines)}".replace("\n\n\n", "\n\n")


def _text(lines: Iterable[str]) -> str:
    """Lines as a text that ends with one line break."""
    text = "\n".join(line.rstrip() for part in lines for line in part.split("\n"))
    return re.sub(r"\n{3,}", "\n\n", text).strip("\n") + "\n"


def own_code() -> Lines:
    """What ``genie_sim`` offers, and the names that code of one's own imports."""
    yield "## `genie_sim`"
    yield from (f"\n::: genie_sim.api.{name}" for name in API)
    yield "\n## `genie_sim.extend`\n\nFor a class of your own; constants stand first.\n"
    documented = {}
    for name, value in vars(extend).items():
        if name.startswith("_"):
            continue
        if inspect.isclass(value) or inspect.isfunction(value):
            documented[name] = value
        else:
            yield f"- `{name}`"
    for name, value in documented.items():
        yield f"\n::: {value.__module__}.{name}"


def commands() -> Lines:
    """What ``--help`` says of every command, and of what a command consists of."""
    yield from _help()
    for name, command in app.commands.items():
        yield from _help(name)
        for inner in command.commands if isinstance(command, click.Group) else ():
            yield from _help(name, inner)


def _help(*words: str) -> Lines:
    runner = CliRunner(env={"NO_COLOR": "1", "COLUMNS": "100"})
    with mock.patch.object(add_ons, "names", return_value=()):  # of this package alone
        ran = runner.invoke(app, [*words, "--help"], prog_name="genie-sim", terminal_width=100)
    assert ran.exit_code == 0, ran.output
    yield f"## {' '.join(('genie-sim', *words))}\n\n```text\n{ran.output.strip()}\n```\n"


def tables() -> Lines:
    """The columns of every table; those of several first."""
    schemas = records.SCHEMAS.values()
    uses = Counter(column for table in schemas for column in table.columns)
    shared = [column for column, tables in uses.items() if tables > 3]
    yield "## Columns of several tables\n"
    yield from _columns(shared)
    for table in schemas:
        names = [f"`{column.name}`" for column in table.columns if column in shared]
        above = f" Also: {', '.join(names)}." if names else ""
        yield f"## {table.name}.parquet\n\n{table.description}{above}\n"
        yield from _columns(column for column in table.columns if column not in shared)


def _columns(columns: Iterable[Column]) -> Lines:
    yield "| column | meaning |\n|---|---|"
    for column in columns:
        unit = f" [{column.unit}]" if column.unit else ""
        null = " (or null)" if column.nullable and "null" not in column.description else ""
        yield f"| `{column.name}` | {_cell(column.description)}{unit}{null} |"
    yield ""


def metrics() -> Lines:
    """Every metric with its unit and its meaning."""
    for name, metric in registry.METRICS.items():
        yield f"- `{name}`, {metric.label}{BETTER[metric.better]}: {_cell(metric.meaning)}"


def _cell(text: str) -> str:
    return " ".join(text.split()).replace("``", "`").replace("|", "\\|")
