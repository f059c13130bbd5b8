"""Arguments of several commands, those with a syntax of their own, and what the shell may complete of them."""

import math
import re
from pathlib import Path
from typing import Annotated, Any

import typer

from genie_sim import plugins
from genie_sim.errors import UserError, short_repr
from genie_sim.paths import expanded

MOST_COUNT = 1024
_DIGITS = re.compile("[0-9]{1,9}")
_UNPRINTABLE = re.compile(r"[\x00-\x1f\x7f\ud800-\udfff]")


def _scenarios(incomplete: str) -> list[str]:
    """Scenarios that a shell may complete; paths it completes itself."""
    from genie_sim import files

    return [name for name in files.available(files.SCENARIO) if name.startswith(incomplete)]


def kinds(incomplete: str) -> list[str]:
    """What ``genie-sim list`` can list."""
    from genie_sim.catalogue import KINDS

    return [kind for kind in KINDS if kind.startswith(incomplete)]


def _setting_paths(incomplete: str) -> list[str]:
    """``PATH=`` of every field that ``--set`` takes; of lists, the first entry's."""
    from genie_sim.core.rules import GenieRules, ObjectMapRules
    from genie_sim.scenario.fields import Model
    from genie_sim.scenario.parts import Car, Edge, Route
    from genie_sim.scenario.plain import model_of
    from genie_sim.scenario.scenario import Scenario

    places: dict[str, type[Model]] = {
        "": Scenario,
        "cars[0].": Car,
        "cars[0].route.": Route,
        "edges[0].": Edge,
        "genie.": model_of(GenieRules),
        "genie.object_map.": model_of(ObjectMapRules),
    }
    paths = [f"{place}{name}=" for place, model in places.items() for name in model.yaml_names()]
    return [path for path in paths if path.startswith(incomplete)]


def _methods(incomplete: str) -> list[str]:
    """Names of methods, after those that are there already."""
    from genie_sim.methods import METHODS

    before, comma, last = incomplete.rpartition(",")
    return [f"{before}{comma}{name}" for name in METHODS if name.startswith(last)]


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
MethodsOption = Annotated[
    str | None,
    typer.Option(
        metavar="A,B,...",
        help="Only these: methods of the scenario, of 'list methods', or module:Class.",
        autocompletion=_methods,
    ),
]
def _own_code(context: typer.Context, value: bool) -> bool:
    """Holds from here to the end of the command, whatever it does with the option."""
    context.with_resource(plugins.own_code(value))
    return value


OwnCodeOption = Annotated[  # of every command that reads result folders
    bool, typer.Option("--allow-own-code", help="Import classes that a folder names.", callback=_own_code)
]
SeedOption = Annotated[int | None, typer.Option(min=0, help="Root of all random streams; default: the scenario's.")]


def path_option(**about: Any) -> Any:
    """An option that takes a path; every one of them does so in the same way."""
    return typer.Option(callback=_path, **about)


def path_argument(**about: Any) -> Any:
    """The same for an argument."""
    return typer.Argument(callback=_path, **about)


def _path(parameter: typer.CallbackParam, value: Path | None) -> Path | None:
    """With the user's home where the shell has not put it. Raises ``UserError`` for what no screen can show."""
    if value is None:
        return None
    if bad := _UNPRINTABLE.search(str(value)):
        raise UserError(f"{parameter.opts[0]}: {short_repr(str(value))} holds the character {bad[0]!r}")
    return expanded(value)


def width_height(option: str, text: str | None) -> tuple[int, int] | None:
    """``832x256``."""
    if text is None:
        return None
    width, height = map(_count, text.partition("x")[::2])
    if width is None or height is None:
        raise UserError(f"{option}: {short_repr(text)} is no width and height in pixels, such as 832x256")
    return width, height


def geodetic(option: str, text: str | None) -> tuple[float, float, float] | None:
    """``49.01,8.42,112.8``: latitude and longitude in degrees, altitude in metres."""
    if text is None:
        return None
    try:
        if not text.isascii() or "_" in text:  # float() reads the digits of every script, and 4_9
            raise ValueError
        latitude, longitude, altitude_m = map(float, text.split(","))
    except ValueError as error:
        such = "is no latitude, longitude, altitude, such as 49.01,8.42,112.8"
        raise UserError(f"{option}: {short_repr(text)} {such}") from error
    for name, value, most in (("latitude", latitude, 90), ("longitude", longitude, 180)):
        if not abs(value) <= most:
            raise UserError(f"{option}: {short_repr(text)}: {name} {value} is not between -{most} and {most} degrees")
    if not math.isfinite(altitude_m):
        raise UserError(f"{option}: {short_repr(text)}: altitude {altitude_m} is no number of metres")
    return latitude, longitude, altitude_m


def count_or_auto(option: str, text: str) -> int | None:
    """``4`` or ``auto``, which is ``None``: to be found out."""
    if text == "auto":
        return None
    count = _count(text)
    if count is None or not 1 <= count <= MOST_COUNT:
        raise UserError(f"{option}: {short_repr(text)} is neither auto nor a number from 1 to {MOST_COUNT}")
    return count


def shard(text: str) -> tuple[int, int]:
    """``2/8`` to (2, 8)."""
    number, of = map(_count, text.partition("/")[::2])
    if number is None or of is None or not 1 <= number <= of:
        raise typer.BadParameter(f"--shard {short_repr(text)}: must be I/N with I from 1 to N, such as 2/8")
    return number, of


def _count(text: str) -> int | None:
    """A number of up to nine digits, 0 to 9 alone: Python reads those of every script, but not five thousand."""
    return int(text) if _DIGITS.fullmatch(text) else None
