"""What an importer tells of a file that somebody else wrote: what was read, what was left out and
why, what was chosen among several, and what is unusual or cannot be.
"""

import math
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from itertools import pairwise
from typing import Any, TypeVar

from genie_sim.base.classes import NO_CLASS, ROAD_LABELS
from genie_sim.base.errors import UserError, short_repr, unknown
from genie_sim.base.text import one_line

MAX_LINES = 10
PARTS = ("read", "left out", "labels not used", "chosen", "ranges", "ways")
MAX_NAMED = 6  # of labels, ranges and ways in one line
FASTEST_MPS = 100.0  # no car; what goes faster from one step to the next has other units
SLOWEST_MPS = 0.002  # what moves at all is faster; degrees taken for metres are not
FAST_SHARE, FEW_STEPS = 0.01, 3  # of the steps may be faster: a fix that jumps
LONG_GAP_S, GAP_PERIODS = 1.0, 5
MAX_GAP_S = 3600.0  # no recording pauses for longer; a clock that is set does
LONG_PERIOD_S = 5.0  # between two places of a car; in between it drives straight
SHORT_PERIOD_S = 0.001  # nobody records as often; times in another unit look so
USUAL_PERIOD_S = 0.005  # few record as often
SLOW_MPS = 0.1  # what drives is faster; kilometres taken for metres are not
FEW_VALUES, FAR_OUT = 10, 100  # a value that is so many times the median stands for none
DRIVES_MPS = 1.0  # what is faster has a course
ASKEW_RAD = math.radians(45.0)  # what looks farther away from it is worth a word
MAX_RADIANS = math.tau + math.pi / 2  # of a heading, whichever way it counts
FROM_NORTH = "count clockwise from north, in degrees"
FROM_EAST = "count counter-clockwise from east; a compass bearing does not"
DROPPED_SHARE = 0.5  # what loses more has another content than it claims

Row = TypeVar("Row")


class ImportReport:
    """The report of one import of ``path``. ``accept``: what cannot be is told as a warning, not
    refused; ``option`` is how a user says so.
    """

    def __init__(self, path: object, accept: bool = False, option: str = "--accept") -> None:
        self.path, self.accept, self.option = path, accept, option
        self.counts: Counter[str] = Counter()
        self.left_out: Counter[str] = Counter()
        self.unused: Counter[str] = Counter()
        self.chosen: list[str] = []
        self.warnings: list[str] = []
        self._ranges: dict[str, tuple[float, float, str]] = {}
        self.ways: dict[str, str] = {}

    def read(self, what: str, count: int) -> None:
        """So many of something were read."""
        self.counts[what] += count

    def leave_out(self, why: str, count: int = 1) -> None:
        """So many were left out, and why, such as ``"fixes without a position"``."""
        if count:
            self.left_out[why] += count

    def leave_label(self, label: str, count: int = 1) -> None:
        """A detection was left out because nobody knows its label; ``check_labels`` counts it."""
        self.unused[one_line(label)[:60]] += count

    def check_labels(self, known: int, others: Mapping[str, int], path: object = None) -> None:
        """Warns of detections with labels that are no classes, which are kept. Raises UserError
        where most have such labels, kept or left out.

        Parameters
        ----------
        known : how many have a class
        others : how many of those that are kept have none, by label
        path : of the file with the detections
        """
        left_out, none = self.unused.total(), self.unused[NO_CLASS]
        unknown_labels = sum(others.values()) + left_out - none
        most = (self.unused + Counter(others)).most_common(3)
        some = ", ".join(short_repr(label) for label, _ in most)
        text = (
            f"{unknown_labels:,} of {known + sum(others.values()) + left_out:,} detections have "
            f"labels that are no classes, such as {some}"
        )
        classes = f"classes: {', '.join(sorted(ROAD_LABELS))}"
        if unknown_labels > known + none:
            self.refuse(f"{text}: say --map LABEL=CLASS; {classes}", path)
        elif others:
            self.warn(f"{text}; {classes}")

    def choose(self, what: str, chosen: str, among: Sequence[str], option: str = "") -> None:
        """One source was chosen among several, and which ``option`` chooses another."""
        if len(among) > 1:
            others = ", ".join(name for name in among if name != chosen)
            advice = f" ({option})" if option else ""
            self.chosen.append(f"{what}: {chosen}, not {others}{advice}")

    def span(self, what: str, values: Iterable[float], unit: str) -> None:
        """The range of some values; nothing for none."""
        numbers = list(values)
        if numbers:
            low, high, _ = self._ranges.get(what, (min(numbers), max(numbers), unit))
            self._ranges[what] = (min(low, *numbers), max(high, *numbers), unit)

    def warn_unusual(
        self, what: str, value: float, unit: str, usual: tuple[float, float], of: str
    ) -> None:
        """Warns of a value that is not between those that are ``usual`` ``of`` something, as if it
        were in another unit.
        """
        low, high = usual
        if not low <= value <= high:
            between = f"{_short_number(low)} to {_short_number(high)} {unit}"
            text = f"{what} {_short_number(value)} {unit}, unusual {of} ({between})"
            self.warn(f"{text}: is it in another unit?")

    def warn_sentinels(self, what: str, values: Sequence[float], unit: str) -> None:
        """Warns of numbers that look as if they stood for none: all the same, or far beyond all
        others.
        """
        if len(values) < FEW_VALUES:
            return
        if min(values) == max(values):
            self.warn(
                f"{what}: always {_short_number(max(values))} {unit}: does that stand for unknown?"
            )
            return
        limit = FAR_OUT * sorted(values)[len(values) // 2]
        beyond = [value for value in values if value > limit > 0]
        if beyond:
            self.warn(
                f"{what}: {len(beyond):,} of {len(values):,} values are more than {FAR_OUT} times "
                f"the median, up to {_short_number(max(beyond))} {unit}: do they stand for unknown?"
            )

    def warn(self, text: str) -> None:
        """Something is unusual."""
        self.warnings.append(text)

    def refuse(self, text: str, path: object = None) -> None:
        """Something in a file cannot be. Raises UserError, unless it is accepted."""
        if not self.accept:
            raise UserError(f"{path or self.path}: {text}; {self.option} reads it all the same")
        self.warn(text)

    def check_dropped(self, what: str, kept: int, of: int, why: str) -> None:
        """``kept`` of so many remain. Raises UserError where most are gone."""
        if kept < of * (1 - DROPPED_SHARE):
            self.refuse(f"{of - kept:,} of {of:,} {what} would be left out: {why}")
        self.leave_out(f"{what}: {why}", of - kept)

    def check_times(
        self, what: str, times_s: Sequence[float], between: str, long_s: float = LONG_PERIOD_S
    ) -> None:
        """Times in order. Warns of long periods and gaps, and raises UserError for such as no
        recording has.

        Parameters
        ----------
        what : whose times they are
        times_s : when there is a row
        between : what is assumed between two rows
        long_s : the longest usual time from row to row
        """
        import numpy as np

        steps_s = np.diff(np.asarray(times_s, dtype=float))
        if not len(steps_s):
            return
        period_s = float(np.median(steps_s))
        told = f"{what}: a row every {period_s:.3g} s; {between}"
        if period_s > long_s or period_s <= SHORT_PERIOD_S:
            self.refuse(f"{told}: are the times in another unit than they say?")
        elif period_s > long_s / GAP_PERIODS or period_s < USUAL_PERIOD_S:
            self.warn(told)
        self.check_gaps(what, times_s)

    def check_gaps(self, what: str, times_s: Sequence[float]) -> None:
        """Warns of the longest gap between times in order, if it is longer than usual. Raises
        UserError for one that no recording has.
        """
        import numpy as np

        steps_s = np.diff(np.asarray(times_s, dtype=float))
        longest_s = float(steps_s.max(initial=0.0))
        usual_s = GAP_PERIODS * float(np.median(steps_s)) if len(steps_s) else 0.0
        if longest_s > max(MAX_GAP_S, usual_s):
            self.refuse(f"{what}: a gap of {longest_s:.3g} s: was the clock set in between?")
        elif longest_s > max(LONG_GAP_S, usual_s):
            self.warn(f"{what}: a gap of {longest_s:.3g} s")

    def check_way(self, name: str, times_s: Sequence[float], places: Any) -> None:
        """Where one car was, in order of time; ``places`` (n, 2) [m]. Warns of gaps; raises
        UserError where it goes faster than any car, or where too few places are known.
        """
        import numpy as np

        t_s, at_m = np.asarray(times_s, dtype=float), np.asarray(places, dtype=float)
        if len(t_s) < 2:
            return
        passed_s, steps_m = np.diff(t_s), np.hypot(*np.diff(at_m[:, :2], axis=0).T)
        with np.errstate(divide="ignore", invalid="ignore"):
            speeds = np.where(passed_s > 0, steps_m / passed_s, np.where(steps_m > 0, np.inf, 0.0))
        duration_s = float(t_s[-1] - t_s[0])
        rate = (len(t_s) - 1) / duration_s if duration_s > 0 else 0.0
        self.ways[name] = (
            f"{duration_s:,.4g} s at {rate:.3g} Hz, path {steps_m.sum():,.4g} m, "
            f"top speed {speeds.max():.3g} m/s"
        )
        self.check_speeds(name, speeds, duration_s)
        self.check_times(name, t_s.tolist(), "in between it drives straight")

    def in_order(self, what: str, rows: Sequence[Row], key: Callable[[Row], Any]) -> list[Row]:
        """Rows in order of time, which ``key`` tells. Warns where they are in another."""
        times = [key(row) for row in rows]
        early = sum(after < before for before, after in pairwise(times))
        if early:
            self.warn(f"{what}: {early:,} rows are earlier than the one before: sorted by time")
        return sorted(rows, key=key)

    def check_heading(
        self, what: str, angle_deg: Any, *, steps_m: Any, passed_s: Any, from_north: bool = False
    ) -> None:
        """Warns of a heading beside the way driven. Raises UserError for radians that were read as
        degrees.

        Parameters
        ----------
        what : whose heading
        angle_deg : counter-clockwise from east, or clockwise from north [degrees] (n,)
        steps_m, passed_s : as of ``askew_rad``
        from_north : whether it counts from there
        """
        import numpy as np

        def askew(angle_rad: Any) -> float:
            heading_rad = math.pi / 2 - angle_rad if from_north else angle_rad
            return askew_rad(heading_rad, steps_m, passed_s)

        off_rad = askew(np.radians(angle_deg))
        may_be_radians = abs(angle_deg).max(initial=0.0) <= MAX_RADIANS
        if off_rad > ASKEW_RAD / 3 and may_be_radians and askew(angle_deg) < off_rad / 3:
            self.refuse(f"{what} fits the way driven as radians, not as degrees")
        if off_rad > ASKEW_RAD:
            off_deg = math.degrees(off_rad)
            counts = FROM_NORTH if from_north else FROM_EAST
            self.warn(f"{what} is {off_deg:.0f} degrees beside the way driven: it must {counts}")

    def check_speeds(self, name: str, speeds_mps: Any, duration_s: float) -> None:
        """The speeds from step to step. Raises UserError where they are none of a car."""
        top_mps, steps = float(speeds_mps.max(initial=0.0)), len(speeds_mps)
        fast = int((speeds_mps > FASTEST_MPS).sum())
        told = f"{name}: {fast:,} of {steps:,} steps are faster than {FASTEST_MPS:g} m/s, up to "
        told += f"{top_mps:.3g} m/s"
        if fast > max(FAST_SHARE * steps, FEW_STEPS):
            self.refuse(f"{told}: are places in metres and times in seconds?")
        elif fast:
            self.warn(told)
        if 0 < top_mps < SLOWEST_MPS and duration_s > LONG_GAP_S:
            self.refuse(
                f"{name}: nothing moves faster than {top_mps:.2g} m/s: are places in degrees? They "
                "must be in metres, and times in seconds"
            )
        elif 0 < top_mps < SLOW_MPS and duration_s > LONG_GAP_S:
            self.warn(f"{name}: never faster than {top_mps:.2g} m/s: are places in metres?")

    def lines(self, only: Collection[str] = PARTS) -> list[str]:
        """The report, in at most ten lines; of what was read ``only`` these parts, and warnings."""
        parts = {
            "read": _listed(f"{count:,} {what}" for what, count in self.counts.items()),
            "left out": _listed(f"{count:,} {why}" for why, count in self.left_out.items()),
            "labels not used": _listed(
                f"{label} ({count:,})" for label, count in self.unused.most_common()
            ),
            "chosen": "; ".join(self.chosen[:MAX_NAMED]),
            "ranges": _listed(
                f"{what} {_short_number(low)} to {_short_number(high)} {unit}".rstrip()
                for what, (low, high, unit) in self._ranges.items()
            ),
            "ways": _listed((f"{name}: {way}" for name, way in self.ways.items()), "; "),
        }
        if parts["labels not used"]:
            parts["labels not used"] += "; --map LABEL=CLASS takes them for a class"
        lines = [f"{name}: {text}" for name, text in parts.items() if text and name in only]
        room = MAX_LINES - len(lines)
        warnings = [f"warning: {text}" for text in self.warnings]
        if len(warnings) > room:
            left = len(warnings) - room + 1
            warnings[room - 1 :] = [f"warning: {left} more, such as {self.warnings[room - 1]}"]
        return [one_line(line) for line in lines + warnings]

    def facts(self) -> dict[str, Any]:
        """The report as plain data, for what an import keeps of itself; only what there is."""
        facts: Mapping[str, Any] = {
            "read": dict(self.counts),
            "left_out": dict(self.left_out),
            "labels_not_used": dict(self.unused),
            "chosen": list(self.chosen),
            "ranges": {
                what: {"lowest": low, "highest": high, "unit": unit}
                for what, (low, high, unit) in self._ranges.items()
            },
            "ways": self.ways,
            "warnings": list(self.warnings),
        }
        return {name: value for name, value in facts.items() if value}


def askew_rad(heading_rad: Any, steps_m: Any, passed_s: Any) -> float:
    """How far a heading is beside the way driven from there, in the median; 0 where nobody drives.

    Parameters
    ----------
    heading_rad : counter-clockwise from east (n,)
    steps_m : how far east and north it goes (n, 2)
    passed_s : how long that takes (n,)
    """
    import numpy as np

    heading, steps = np.asarray(heading_rad, dtype=float), np.asarray(steps_m, dtype=float)
    drives = np.hypot(*steps.T) > DRIVES_MPS * np.asarray(passed_s, dtype=float)
    if not drives.any():
        return 0.0
    course = np.arctan2(*steps[drives].T[::-1])
    off = (heading[drives] - course + math.pi) % math.tau - math.pi
    return float(np.median(np.abs(off)))


def class_map(option: str, pairs: Iterable[str], classes: Collection[str]) -> dict[str, str]:
    """The classes of labels, of texts such as ``pedestrian=person``. Raises UserError."""
    chosen: dict[str, str] = {}
    for pair in pairs:
        label, mark, name = pair.partition("=")
        if not mark or not label.strip():
            raise UserError(f"{option}: must be LABEL=CLASS, not {short_repr(pair)}")
        if name.strip() not in classes:
            raise UserError(f"{option} {label}: {unknown('class', name.strip(), classes)}")
        chosen[label.strip()] = name.strip()
    return chosen


def _short_number(value: float) -> str:
    """Four digits, or all before the point."""
    return f"{value:,.0f}" if abs(value) >= 1000 else f"{value:.4g}"


def _listed(texts: Iterable[str], mark: str = ", ") -> str:
    """Texts in one line, no more than a few."""
    parts = list(texts)
    more = [f"and {len(parts) - MAX_NAMED:,} more"] if len(parts) > MAX_NAMED else []
    return mark.join(parts[:MAX_NAMED] + more)
