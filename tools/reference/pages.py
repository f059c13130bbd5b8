"""The pages of the reference that are made with the site (``tools/reference/site.py``)."""

from __future__ import annotations

import inspect
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from typing import Any
from unittest import mock

import click
from click.testing import CliRunner

from genie_sim import extend
from genie_sim.analysis import registry
from genie_sim.base import add_ons, files
from genie_sim.base.units import duration_text, rate_text
from genie_sim.cli import catalogue
from genie_sim.cli.main import app
from genie_sim.links.presets import LINKS
from genie_sim.record import records
from genie_sim.record.tables import Column
from genie_sim.scenario.power import INTERFACES, DevicePower, InterfacePower, parts
from genie_sim.scenario.profiles import DeviceProfile, load_profile
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
LAWS = """\
Tags: **P** from the paper, **S** a public source, **M** measured, **D** derived, **A** assumed. A
service time is median × (loc + (1 − loc) exp(sigma × Z)), Z standard normal. [Add a
device](../extend/device.md).
"""
API = ("run", "run_seeds", "sweep", "load", "compare", "reproduce", "load_scenario")
API += ("Run", "Runs", "Comparison", "Plots")
PYTHON = """\
[Python](api.md) shows how to use these, [Extend it](../extend/method.md) how to add to them.
"""

NULL = "A column holds measurements. Null means unknown or never, not zero.\n"
LINK = """\
`genie_sim/links/presets.py` has the source of every number. [Add a
link](../extend/link.md).
"""
INTERFACE = """\
## Network interfaces

What a car's interface takes ([Measure what a method costs](../how-to/energy.md)): `port` always,
`transfer` while it sends or receives, `up` and `down` per megabit, `tail` while it stays awake
after a transfer (4G: 11.6 s).
"""
NAMES = """\
What `genie-sim list` shows: names for scenarios and commands. [Extend it](../extend/method.md)
shows how to add one of your own, `module:Class`; `genie-sim show NAME` prints a scenario or a
sweep. The metrics, devices and links have pages of their own.
"""
METRIC = """\
The name is that in `metrics.json`; shares are from 0 to 1 there. ↑: more is
[better](../how-to/compare.md); ↓: less is. [Add a metric](../extend/metric.md).
"""
BETTER = {"higher": " ↑", "lower": " ↓", "": ""}

KINDS = (
    *("methods", "faults", "sources", "link-models", "similarities", "evictions"),
    *("rules", "detectors", "models", "scenarios", "sweeps"),
)

Lines = Iterator[str]


def texts() -> dict[str, str]:
    """The pages below docs by their path."""
    profiles = {name: load_profile(name) for name in files.available(files.DEVICE)}
    pages = {
        "cli": _page("Command line", CLI, commands()),
        "scenario": _page("Settings of a scenario", SETTINGS, settings()),
        "metrics": _page("Metrics", METRIC, metrics()),
        "tables": _page("Tables", NULL, tables()),
        "devices": _page("Devices", LAWS, devices(profiles)),
        "links": _page("Links", LINK, links()),
        "names": _page("Methods, faults and other names", NAMES, names(KINDS)),
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


def names(kinds: Iterable[str]) -> Lines:
    """What can be named, each with a line about it."""
    for kind in kinds:
        yield f"## {kind}\n\n| name | about |\n|---|---|"
        yield from (f"| `{name}` | {_cell(about)} |" for name, about in catalogue.KINDS[kind]())
        yield ""


def links() -> Lines:
    """Rates and delays of every link, and powers of every interface."""
    yield "| name | up | down | delay | jitter |\n|---|---:|---:|---:|---:|"
    for name, link in LINKS.items():
        of = link.parameters
        both = (of["rate_up_bps"], of["rate_down_bps"])
        rates = (rate_text(rate) if rate is not None else "no limit" for rate in both)
        yield (
            f"| `{name}` | {' | '.join(rates)} | {duration_text(of['delay_ns'])} |"
            f" {duration_text(of['jitter_ns'])} |"
        )
    yield f"\n{INTERFACE}"
    yield "| interface | what | value | range | tag | source |\n|---|---|---:|---:|---|---|"
    for name, power in INTERFACES.items():
        source = f"{power.tag} | {_cell(power.source)}"
        yield from (f"| `{name}` {row} | {source} |" for row in _powers(power))


def _powers(power: DevicePower | InterfacePower) -> Lines:
    """Part, value and range of each power that is not nothing."""
    for part, of_part in parts(power):
        unit = "J/Mbit" if part in ("up", "down") else "W"
        if of_part.high:
            low, high = of_part.low, of_part.high
            yield f"| {part} | {of_part.value:.4g} {unit} | {low:.3g} to {high:.3g}"


def devices(profiles: Mapping[str, DeviceProfile]) -> Lines:
    """Every number of every device profile, with its source."""
    for name, device in profiles.items():
        yield f"## {device.title}\n\n`{name}`\n"
        yield "| what | value | tag | source |\n|---|---:|---|---|"
        for what, value, number in _numbers(device):
            yield f"| {what} | {value} | {number.tag} | {_cell(number.source)} |"
        yield ""


def _numbers(device: DeviceProfile) -> Iterator[tuple[str, object, Any]]:
    """What each number is of, as text, and the number with tag and source."""
    yield "CPU cores", device.cores.value, device.cores
    small, per_megabyte = device.hop.small, device.hop.per_megabyte
    yield "IPC, fixed part", duration_text(small.value_ns), small
    yield "IPC, per megabyte", duration_text(per_megabyte.value_ns), per_megabyte
    median, spread = device.genie_time.median, device.genie_time.spread
    yield "Genie, a message, median", duration_text(median.value_ns), median
    yield "Genie, loc and sigma", f"{spread.loc}, {spread.sigma}", spread
    yield "encoding pictures, factor", f"{device.codec.value:g}", device.codec
    for name in ("isolated", "default", "loaded"):
        law = getattr(device.spreads, name)
        yield f"spread `{name}`, loc and sigma", f"{law.loc}, {law.sigma}", law
    for part in ("idle", "accelerator", "core") if device.power is not None else ():
        watts = getattr(device.power, part)
        value = f"{watts.value_w:g} W ({watts.low_w:g} to {watts.high_w:g})"
        yield f"power, {part}", value, watts
    for name, model in device.models.items():
        time = "out of memory" if model.median_ns is None else duration_text(model.median_ns)
        yield f"`{name}`, median", time, model
        if model.batch.fixed:
            what = f"`{name}`, share of a batch's time that does not grow"
            yield what, model.batch.fixed, model.batch


def _cell(text: str) -> str:
    return " ".join(text.split()).replace("``", "`").replace("|", "\\|")
