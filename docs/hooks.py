"""Fills the reference from the program itself when the site is built: ``<!-- generated: NAME -->``
names what.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))
sys.path.insert(0, str(Path(__file__).resolve().parent))

from settings import settings

from genie_sim.base import files
from genie_sim.base.units import duration_text, rate_text
from genie_sim.cli import catalogue
from genie_sim.record import records
from genie_sim.scenario.power import INTERFACES, DevicePower, InterfacePower, parts
from genie_sim.scenario.profiles import DeviceProfile, load_profile
from genie_sim.sim.link_models.presets import LINKS


def commands() -> Iterator[str]:
    """What ``--help`` says of every command."""
    listed = _help().partition("Commands:")[2]
    for name in re.findall(r"^  ([a-z]+)  ", listed, re.MULTILINE):
        yield f"## genie-sim {name}\n\n```text\n{_help(name).strip()}\n```\n"


def tables() -> Iterator[str]:
    """The columns of every table."""
    for table in records.SCHEMAS.values():
        yield f"## {table.name}.parquet\n\n{table.description}\n"
        yield "| column | type | unit | meaning |\n|---|---|---|---|"
        for column in table.columns:
            kind = f"{column.kind} or null" if column.nullable else column.kind
            yield f"| `{column.name}` | {kind} | {column.unit} | {_cell(column.description)} |"
        yield ""


def devices() -> Iterator[str]:
    """Every number of every device profile, with its source."""
    for name in files.available(files.DEVICE):
        device = load_profile(name)
        yield (
            f"## {device.title}\n\n`{name}`\n\n| what | value | tag | source |\n|---|---:|---|---|"
        )
        yield from _numbers(device)
        yield ""


def links() -> Iterator[str]:
    yield "| name | up | down | delay | jitter |\n|---|---:|---:|---:|---:|"
    for name, link in LINKS.items():
        of = link.parameters
        both = (of["rate_up_bps"], of["rate_down_bps"])
        rates = (rate_text(rate) if rate is not None else "no limit" for rate in both)
        yield (
            f"| `{name}` | {' | '.join(rates)} | {duration_text(of['delay_ns'])} |"
            f" {duration_text(of['jitter_ns'])} |"
        )


def interfaces() -> Iterator[str]:
    yield "| interface | what | value | range | tag | source |\n|---|---|---:|---:|---|---|"
    for name, power in INTERFACES.items():
        source = f"{power.tag} | {_cell(power.source)}"
        yield from (f"| `{name}` {row} | {source} |" for row in _powers(power))


def _powers(power: DevicePower | InterfacePower) -> Iterator[str]:
    """Part, value and range of each power that is not nothing."""
    for part, of_part in parts(power):
        unit = "J/Mbit" if part in ("up", "down") else "W"
        if of_part.high:
            low, high = of_part.low, of_part.high
            yield f"| {part} | {of_part.value:.4g} {unit} | {low:.3g} to {high:.3g}"


def detectors() -> Iterator[str]:
    yield "| name | about |\n|---|---|"
    yield from (f"| `{name}` | {_cell(about)} |" for name, about in catalogue.KINDS["detectors"]())


def all_settings() -> Iterator[str]:
    """The scenario that shows every setting, without the editor's first line."""
    text = files.available(files.SCENARIO)["all_settings"].read_text(encoding="utf-8")
    yield f"```yaml\n{text.partition(chr(10))[2].strip()}\n```"


GENERATED: dict[str, Callable[[], Iterator[str]]] = {
    one.__name__: one
    for one in (commands, tables, devices, links, interfaces, detectors, settings, all_settings)
}


def on_page_markdown(markdown: str, **_: object) -> str:
    """Called by MkDocs for every page."""
    return re.sub(
        r"<!-- generated: (\w+) -->", lambda found: "\n".join(GENERATED[found[1]]()), markdown
    )


def _numbers(device: DeviceProfile) -> Iterator[str]:
    yield (
        f"| CPU cores | {device.cores.value} | {device.cores.tag} | {_cell(device.cores.source)} |"
    )
    for what, law in (
        ("hop, fixed part", device.hop.small),
        ("hop, per megabyte", device.hop.per_megabyte),
    ):
        yield f"| {what} | {duration_text(law.value_ns)} | {law.tag} | {_cell(law.source)} |"
    median, spread = device.genie_time.median, device.genie_time.spread
    yield (
        f"| Genie, a message, median | {duration_text(median.value_ns)} | {median.tag} |"
        f" {_cell(median.source)} |"
    )
    yield (
        f"| Genie, loc and sigma | {spread.loc}, {spread.sigma} | {spread.tag} |"
        f" {_cell(spread.source)} |"
    )
    yield (
        f"| encoding pictures, factor | {device.codec.value:g} | {device.codec.tag} |"
        f" {_cell(device.codec.source)} |"
    )
    for name in ("isolated", "default", "loaded"):
        law = getattr(device.spreads, name)
        yield (
            f"| spread `{name}`, loc and sigma | {law.loc}, {law.sigma} | {law.tag} |"
            f" {_cell(law.source)} |"
        )
    for part in ("idle", "accelerator", "core") if device.power is not None else ():
        watts = getattr(device.power, part)
        value = f"{watts.value_w:g} W ({watts.low_w:g} to {watts.high_w:g})"
        yield f"| power, {part} | {value} | {watts.tag} | {_cell(watts.source)} |"
    for name, model in device.models.items():
        time = "out of memory" if model.median_ns is None else duration_text(model.median_ns)
        yield f"| `{name}`, median | {time} | {model.tag} | {_cell(model.source)} |"
        if model.batch.fixed:
            batch = model.batch
            yield (
                f"| `{name}`, share of a batch's time that does not grow | {batch.fixed} |"
                f" {batch.tag} | {_cell(batch.source)} |"
            )


def _help(*command: str) -> str:
    return subprocess.run(
        [sys.executable, "-m", "genie_sim", *command, "--help"],
        check=True,
        capture_output=True,
        text=True,
        cwd=Path(__file__).resolve().parent.parent,
        env={**os.environ, "COLUMNS": "100", "NO_COLOR": "1"},
    ).stdout


def _cell(text: str) -> str:
    return " ".join(text.split()).replace("|", "\\|")


def _paragraph(docstring: str | None) -> str:
    return (docstring or "").strip().split("\n\n")[0]
