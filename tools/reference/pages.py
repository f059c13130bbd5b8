"""The pages of the reference: what stands in each of them."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from itertools import chain
from pathlib import Path
from typing import Any
from unittest import mock

import click
from click.testing import CliRunner

import genie_sim
from genie_sim.analysis import (
    correctness,
    frame_metrics,
    genie_metrics,
    looks,
    outages,
    prices,
    registry,
    resource_metrics,
)
from genie_sim.base import add_ons, files
from genie_sim.base.units import duration_text, rate_text
from genie_sim.cli import catalogue
from genie_sim.cli.main import app
from genie_sim.record import records
from genie_sim.scenario.power import INTERFACES, DevicePower, InterfacePower, parts
from genie_sim.scenario.profiles import DeviceProfile, load_profile
from genie_sim.sim.link_models.presets import LINKS
from tools.reference import python
from tools.reference.settings import settings

DOCS = Path(__file__).resolve().parents[2] / "docs"
BEGIN, END = "<!-- metrics: python -m tools.reference -->", "<!-- end -->"

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

The other pages: [perception](scenario-perception.md), [edges and faults](scenario-edges.md),
[Genie's caches](scenario-genie.md), [looks and freshness](scenario-looks.md), and [all settings
in one file](scenario-all.md).
"""
LAWS = """\
Tags: **P** from the paper, **S** a public source, **M** measured, **D** derived, **A** assumed. A
service time is median × (loc + (1 − loc) exp(sigma × Z)), Z standard normal. [Add a
device](../extend/device.md).
"""
PYTHON = """\
[Python](api.md) shows how to use these, [Extend it](../extend/method.md) how to add to them.
"""

NULL = "A column holds measurements. Null means unknown or never, not zero.\n"
LINK = """\
`genie_sim/sim/link_models/presets.py` has the source of every number. [Add a
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
shows how to add one of your own, `module:Class`. The metrics, devices and links have pages of
their own.
"""
METRIC = """\
The name is that in `metrics.json`; shares are from 0 to 1 there. *Rows* says of which rows of a
method the number is made, [better](../how-to/compare.md) which way is. [Add a
metric](../extend/metric.md).
"""
SHOW = "`genie-sim show NAME` prints one, with `--copy-to FILE` it copies it.\n"

COMMANDS = (
    *("run", "report", "reproduce", "rerun", "compare", "figures", "table", "export"),
    *("list", "show"),
)
STEPS = ("frames", "lookups", "looks", "steps", "answers", "held", "held_objects")
BOARD = "NVIDIA Jetson"
MAP = "Genie's object map (Algorithm 2)"
KINDS = (
    *("methods", "faults", "sources", "link-models", "similarities", "evictions"),
    *("rules", "detectors", "models"),
)
SHIPPED = ("scenarios", "sweeps")
METRICS = (
    ("metrics", "answers and accuracy", (frame_metrics, correctness, looks)),
    (
        "metrics-more",
        "caches, costs, faults",
        (genie_metrics, resource_metrics, prices, outages),
    ),
)
ROOMS = (
    ("python-base", "units, random numbers, errors", ("base.units", "base.seeds", "base.errors")),
    ("python-messages", "messages", ("core.messages", "core.monitor")),
    (
        "python-core",
        "Genie's parts",
        (
            *("core.node", "core.message_cache", "core.object_map"),
            *("core.similarity", "core.eviction", "core.confidence"),
        ),
    ),
    (
        "python-freshness",
        "freshness",
        (
            "core.freshness.never",
            "core.freshness.track",
            "core.freshness.existence",
        ),
    ),
    (
        "python-sim",
        "methods, faults and nodes",
        ("sim.method", "sim.fault", "sim.nodes", "sim.ros_graph"),
    ),
    (
        "python-devices",
        "clock, devices and links",
        ("sim.clock", "sim.device", "sim.link", "sim.network", "sim.world"),
    ),
    ("python-data", "frames, traces, detectors", ("data.source", "data.trace", "data.detector")),
    ("python-worlds", "the town", ("worlds.town.town", "worlds.town.rules")),
    ("python-results", "results and metrics", ("record.results", "analysis.metric")),
)

Lines = Iterator[str]


def texts() -> dict[str, str]:
    """Every generated page below docs, and the glossary."""
    glossary = (DOCS / "glossary.md").read_text(encoding="utf-8")
    before, _, rest = glossary.partition(BEGIN)
    after = rest.partition(END)[2]
    pages = {f"reference/{name}.md": text for name, text in _pages()}
    return {**pages, "glossary.md": f"{before}{BEGIN}\n{_text(glossary_metrics())}{END}{after}"}


def _pages() -> Iterator[tuple[str, str]]:
    first = chain(_help(), commands(lambda name: name in COMMANDS))
    yield "cli", _page("Command line", CLI, first)
    others = commands(lambda name: name not in COMMANDS)
    yield "cli-more", _page("Command line: import, measure, sweep", "", others)
    run = ("The run", "Cars", "Convoy", "Fleet", "Cameras")
    yield "scenario", _page("Settings of a scenario", SETTINGS, settings(run))
    for name, title, groups in (
        ("perception", "what cameras see", ("What cameras see",)),
        ("edges", "edges and faults", ("Edges", "Faults")),
        ("genie", "Genie's caches", ("Genie's message cache (Algorithm 1)", MAP)),
        ("looks", "looks and freshness", ("Genie's looks", "Freshness of the map")),
    ):
        yield f"scenario-{name}", _page(f"Settings: {title}", "", settings(groups))
    yield "scenario-all", _page("All settings in one file", "", all_settings())
    yield "tables", _page("Tables: frames and answers", NULL, tables(lambda name: name in STEPS))
    others = tables(lambda name: name not in STEPS)
    yield "tables-more", _page("Tables: hosts, places, faults", NULL, others)
    boards, servers = {}, {}
    for name in files.available(files.DEVICE):
        device = load_profile(name)
        (boards if device.title.startswith(BOARD) else servers)[name] = device
    yield "devices", _page("Devices: boards", LAWS, devices(boards))
    yield "devices-servers", _page("Devices: servers", LAWS, devices(servers))
    yield "links", _page("Links", LINK, links())
    yield "names", _page("Methods, faults and other names", NAMES, names(KINDS))
    yield "names-scenarios", _page("Shipped scenarios and sweeps", SHOW, names(SHIPPED))
    for name, title, modules in METRICS:
        yield name, _page(f"Metrics: {title}", METRIC, metrics(modules))
    exported = ((name, getattr(genie_sim, name)) for name in genie_sim.__all__ if name[0] != "_")
    lines = (line for name, value in exported for line in python.entry(name, value))
    yield "python", _page("Python: genie_sim", PYTHON, lines)
    for name, title, modules in ROOMS:
        lines = (line for module in modules for line in python.module(f"genie_sim.{module}"))
        yield name, _page(f"Python: {title}", PYTHON, lines)


def _page(title: str, intro: str, lines: Iterable[str]) -> str:
    made = "<!-- Made by python -m tools.reference. -->\n"
    return f"{made}# {title}\n\n{intro}\n{_text(lines)}".replace("\n\n\n", "\n\n")


def _text(lines: Iterable[str]) -> str:
    """Lines as a text that ends with one line break."""
    text = "\n".join(line.rstrip() for part in lines for line in part.split("\n"))
    return re.sub(r"\n{3,}", "\n\n", text).strip("\n") + "\n"


def commands(which: Callable[[str], bool]) -> Lines:
    """What ``--help`` says of every command, and of what a command consists of."""
    for name, command in app.commands.items():
        if which(name):
            yield from _help(name)
            for inner in command.commands if isinstance(command, click.Group) else ():
                yield from _help(name, inner)


def _help(*words: str) -> Lines:
    runner = CliRunner(env={"NO_COLOR": "1", "COLUMNS": "100"})
    with mock.patch.object(add_ons, "names", return_value=()):  # of this package alone
        ran = runner.invoke(app, [*words, "--help"], prog_name="genie-sim", terminal_width=100)
    assert ran.exit_code == 0, ran.output
    yield f"## {' '.join(('genie-sim', *words))}\n\n```text\n{ran.output.strip()}\n```\n"


def tables(which: Callable[[str], bool]) -> Lines:
    """The columns of every table."""
    for table in records.SCHEMAS.values():
        if which(table.name):
            yield f"## {table.name}.parquet\n\n{table.description}\n"
            yield "| column | type | unit | meaning |\n|---|---|---|---|"
            for column in table.columns:
                kind = f"{column.kind} or null" if column.nullable else column.kind
                yield f"| `{column.name}` | {kind} | {column.unit} | {_cell(column.description)} |"
            yield ""


def metrics(modules: Iterable[object]) -> Lines:
    """Every metric: what it is, and what it is computed from."""
    for module in modules:
        first = (module.__doc__ or "").partition("\n\n")[0]
        yield f"## {' '.join(first.split())}\n"
        yield "| name | title | unit | better | rows |\n|---|---|---|---|---|"
        for name, metric in module.METRICS.items():  # type: ignore[attr-defined]
            yield f"| `{name}` | {metric.title} | {metric.unit} | {metric.better} | {metric.rows} |"
        yield ""


def glossary_metrics() -> Lines:
    """Every metric with its unit and its meaning."""
    yield "| metric | unit | meaning |\n|---|---|---|"
    for name, metric in registry.METRICS.items():
        yield f"| {metric.title} (`{name}`) | {metric.unit} | {_cell(metric.meaning)} |"


def names(kinds: Iterable[str]) -> Lines:
    """What can be named, each with a line about it."""
    for kind in kinds:
        yield f"## {kind}\n\n| name | about |\n|---|---|"
        yield from (f"| `{name}` | {_cell(about)} |" for name, about in catalogue.KINDS[kind]())
        yield ""


def all_settings() -> Lines:
    """The scenario that shows every setting, without the editor's first line."""
    text = files.available(files.SCENARIO)["all_settings"].read_text(encoding="utf-8")
    yield f"```yaml\n{text.partition(chr(10))[2].strip()}\n```"


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
