"""Arguments of several commands, those with a syntax of their own, and what the shell may complete of them."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from genie_sim.errors import UserError


def _scenarios(incomplete: str) -> list[str]:
    """Scenarios that a shell may complete; paths it completes itself."""
    from genie_sim.experiment import files

    return [name for name in files.available(files.SCENARIO) if name.startswith(incomplete)]


def kinds(incomplete: str) -> list[str]:
    """What ``genie-sim list`` can list."""
    from genie_sim.experiment.catalogue import KINDS

    return [kind for kind in KINDS if kind.startswith(incomplete)]


def _setting_paths(incomplete: str) -> list[str]:
    """``PATH=`` of every field that ``--set`` takes; of lists, the first entry's."""
    from genie_sim.experiment.genie_settings import GenieSettings, ObjectMapSettings
    from genie_sim.experiment.scenario import Car, Edge, Route, Scenario

    places = {
        "": Scenario,
        "cars[0].": Car,
        "cars[0].route.": Route,
        "edges[0].": Edge,
        "genie.": GenieSettings,
        "genie.object_map.": ObjectMapSettings,
    }
    paths = [
        f"{place}{field.alias or name}="
        for place, model in places.items()
        for name, field in model.model_fields.items()
    ]
    return [path for path in paths if path.startswith(incomplete)]


ScenarioArgument = Annotated[
    str,
    typer.Argument(help="A scenario file, or the name of one that comes with genie-sim.", autocompletion=_scenarios),
]
SetOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="PATH=VALUE",
        help="Change a field, such as cars[0].device=orin_nano. Repeatable.",
        autocompletion=_setting_paths,
    ),
]
SeedOption = Annotated[int | None, typer.Option(min=0, help="Root of all random streams; default: the scenario's.")]


def numbers(option: str, text: str | None, separator: str, count: int) -> tuple[Any, ...] | None:
    """``832x256`` or ``49.01,8.42,112.8``: whole numbers where they have no decimal point."""
    if text is None:
        return None
    try:
        found = tuple(float(part) if "." in part else int(part) for part in text.split(separator))
    except ValueError as error:
        raise UserError(f"{option}: {text!r}: {error}") from error
    if len(found) != count:
        raise UserError(f"{option}: {text!r} has {len(found)} numbers, expected {count} with {separator!r} between")
    return found


def shard(text: str) -> tuple[int, int]:
    """``2/8`` to (2, 8)."""
    number, slash, of = text.partition("/")
    if not (slash and number.isdecimal() and of.isdecimal() and 1 <= int(number) <= int(of)):
        raise typer.BadParameter(f"--shard {text}: must be I/N with I from 1 to N, such as 2/8")
    return int(number), int(of)
