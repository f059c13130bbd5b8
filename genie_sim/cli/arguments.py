"""Arguments of several commands, and those with a syntax of their own."""

import math
import re
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from genie_sim.base import plugins
from genie_sim.base.errors import UserError, short_repr
from genie_sim.base.paths import expanded

if TYPE_CHECKING:
    from genie_sim.core.messages import Encoding
    from genie_sim.data.detectors.detector import DetectorSettings

MAX_COUNT = 1024
_DIGITS = re.compile("[0-9]{1,9}")
_UNPRINTABLE = re.compile(r"[\x00-\x1f\x7f\ud800-\udfff]")


def _own_code(_: object, __: object, value: bool) -> None:
    if value:
        plugins.allow_own_code()


class _Path(click.Path):
    """A path, with the user's home where the shell has not put it. Raises ``UserError`` for an
    empty one, and what no screen can show.
    """

    def convert(
        self, value: Any, parameter: click.Parameter | None, context: click.Context | None
    ) -> Path:
        bad = _UNPRINTABLE.search(str(value))
        if parameter is not None and (bad or not str(value)):
            problem = (
                f"{short_repr(str(value))} holds the character {bad[0]!r}" if bad else "is empty"
            )
            raise UserError(f"{parameter.opts[0]}: {problem}")
        return expanded(value)


PATH = _Path()
COUNT = click.IntRange(min=1)

set_option = click.option(
    "--set",
    "set_",
    multiple=True,
    metavar="PATH=VALUE",
    help="Change a field, such as cars[0].device=orin_nano. Repeatable.",
)
methods_option = click.option(
    "--methods",
    metavar="A,B,...",
    help="Only these: methods of the scenario, of 'list methods', or module:Class.",
)
seeds_option = click.option(
    "--seeds",
    metavar="N|A,B,...",
    help="So many seeds, from 1 on, or these; results are means with intervals.",
)
metrics_option = click.option(
    "--metrics",
    metavar="A,B,...",
    help="Only the rows of these metrics, such as first_answer_p99 ('list metrics').",
)
label_option = click.option(
    "--label",
    default="",
    help="What tables and figures call the results; default: the scenario. --out names the folder.",
)

shown_methods_option = click.option(
    "--methods",
    metavar="A,B,...",
    help="Only these, in this order; differences are from the first.",
)
labels_option = click.option(
    "--label",
    "labels",
    multiple=True,
    help="What a result is called; repeat it for each result, in their order.",
)
results_argument = click.argument(
    "folders",
    nargs=-1,
    required=True,
    type=PATH,
    help="Result folders: of a run, a sweep or an evaluation; several runs are compared.",
)
table_format_option = click.option(
    "--format",
    default="markdown",
    help="Of the printed table: markdown, latex, or csv (all digits).",
)

# of commands that spread runs over processes or machines
jobs_option = click.option(
    "--jobs", type=COUNT, help="Processes on this machine; default: one a core."
)

accept_option = click.option(  # of every command that reads files of others
    "--accept", is_flag=True, help="Read what cannot be right all the same; the report says so."
)
map_option = click.option(
    "--map",
    "classes",
    multiple=True,
    metavar="LABEL=CLASS",
    help="Take a label of the file for a class, such as pedestrian=person, or =none.",
)


def detector_options(command: Callable[..., None]) -> Callable[..., None]:
    """The options of every command that runs a detector, for ``detector_settings``."""
    options = (
        click.option(
            "--detector",
            default="yolox_nano",
            help="A detector ('list detectors'), or your own module:Class.",
        ),
        click.option(
            "--weights",
            type=PATH,
            help="The ONNX file, or its folder; default: $GENIE_SIM_WEIGHTS.",
        ),
        click.option("--size", metavar="WxH", help="The network's input, such as 832x256."),
        click.option(
            "--providers",
            default="CPUExecutionProvider",
            help="ONNX Runtime's execution providers, best first, such as CUDAExecutionProvider.",
        ),
        click.option(
            "--threads", type=click.IntRange(1, MAX_COUNT), default=1, help="The network's."
        ),
        map_option,
    )
    for option in reversed(options):
        command = option(command)
    return command


def detector_settings(
    *,
    detector: str,
    weights: Path | None,
    size: str | None,
    providers: str,
    threads: int,
    classes: tuple[str, ...],
    min_score: float,
    encoding: "Encoding" = "raw",
) -> "DetectorSettings":
    """What ``detector_options`` say. Raises ``UserError``."""
    from genie_sim.base.classes import NO_CLASS, ROAD_LABELS
    from genie_sim.base.import_report import class_map
    from genie_sim.data.detectors.detector import DetectorSettings

    return DetectorSettings(
        name=detector,
        weights=weights,
        size=width_height("--size", size),
        min_score=min_score,
        providers=providers.split(","),
        threads=threads,
        encoding=encoding,
        classes=class_map("--map", classes, [*ROAD_LABELS, NO_CLASS]),
    )


own_code_option = click.option(  # of every command that reads result folders
    "--allow-own-code",
    is_flag=True,
    expose_value=False,
    callback=_own_code,
    help="Import classes that a folder names.",
)


def refuse(mode: str, *names: str) -> None:
    """Raises ``UserError`` where one of these parameters of the running command was given: in this
    ``mode`` it would have no effect.
    """
    context = click.get_current_context()
    for parameter in context.command.params:
        name = parameter.name or ""
        given = context.get_parameter_source(name) is ParameterSource.COMMANDLINE
        if given and name in names:
            text = f"{parameter.opts[0]}: has no effect {mode}; see {context.command_path} --help"
            raise UserError(f"{context.info_name}: {text}")


def width_height(option: str, text: str | None) -> tuple[int, int] | None:
    """``832x256``."""
    if text is None:
        return None
    width, height = map(_count, text.partition("x")[::2])
    if width is None or height is None:
        raise UserError(
            f"{option}: {short_repr(text)}: expected WIDTHxHEIGHT in pixels, for example 832x256"
        )
    return width, height


def width_in(text: str | None) -> float | None:
    """A width of ``style.WIDTHS`` by its name, or a number of inches. Raises ``UserError``."""
    if text is None:
        return None
    from genie_sim.analysis.style import WIDTHS

    if text in WIDTHS:
        return WIDTHS[text]
    inches = text.removesuffix("in").strip()
    if re.fullmatch(r"[0-9]{1,2}(\.[0-9]{1,3})?", inches) and 2 <= float(inches) <= 12:
        return float(inches)
    names = ", ".join(WIDTHS)
    raise UserError(
        f"--width: {short_repr(text)}: expected {names}, or inches from 2 to 12, such as 3.5"
    )


def geodetic(option: str, text: str | None) -> tuple[float, float, float] | None:
    """``49.01,8.42,112.8``: latitude and longitude in degrees, altitude in metres."""
    if text is None:
        return None
    try:
        if not text.isascii() or "_" in text:  # float() reads the digits of every script, and 4_9
            raise ValueError
        latitude, longitude, altitude_m = map(float, text.split(","))
    except ValueError as error:
        raise UserError(
            f"{option}: {short_repr(text)}: expected latitude, longitude and altitude, "
            "for example 49.01,8.42,112.8"
        ) from error
    for name, value, limit in (("latitude", latitude, 90), ("longitude", longitude, 180)):
        if not abs(value) <= limit:
            raise UserError(
                f"{option}: {short_repr(text)}: {name} {value} is not between "
                f"-{limit} and {limit} degrees"
            )
    if not math.isfinite(altitude_m):
        raise UserError(
            f"{option}: {short_repr(text)}: altitude {altitude_m} must be a number of metres"
        )
    return latitude, longitude, altitude_m


def quantity(option: str, text: str, read: Callable[[object], Any]) -> Any:
    """What is written with a unit and must be more than zero. Raises ``UserError``."""
    try:
        value = read(text)
    except ValueError as error:
        raise UserError(f"{option}: {error}") from error
    if value <= 0:
        raise UserError(f"{option}: must be more than zero, but is {text}")
    return value


def listed(option: str, text: str | None) -> list[str]:
    """``a,b`` to its names; nothing for no text. Raises ``UserError``."""
    if text is None:
        return []
    names = [name.strip() for name in text.split(",")]
    if not all(names):
        raise UserError(f"{option}: {short_repr(text)}: expected names with commas between them")
    return names


def seeds(text: str | None) -> int | list[int] | None:
    """``5`` is how many, ``3,7`` or ``3,`` are these. Raises ``UserError``."""
    if text is None:
        return None
    numbers = [_count(number.strip()) for number in text.removesuffix(",").split(",")]
    known = [number for number in numbers if number is not None]
    if len(known) < len(numbers) or text == "0":
        raise UserError(
            f"--seeds: {short_repr(text)}: expected how many, such as 5, or which, such as 3,7"
        )
    return known if "," in text else known[0]


def shard(text: str) -> tuple[int, int]:
    """``2/8`` to (2, 8). Raises ``UserError``."""
    number, of = map(_count, text.partition("/")[::2])
    if number is None or of is None or not 1 <= number <= of:
        raise UserError(
            f"--shard: {short_repr(text)}: expected I/N with I from 1 to N, such as 2/8"
        )
    return number, of


def _count(text: str) -> int | None:
    """A number of up to nine digits, 0 to 9 alone: Python reads those of every script, but not five
    thousand.
    """
    return int(text) if _DIGITS.fullmatch(text) else None
