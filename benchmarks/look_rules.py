"""Whether looks may get rarer where a view is predictable: a search for a rule.

    GENIE_SIM_KITTI=... python -m benchmarks.look_rules search|held_out

Declared before any of it was run:

- **Goal**: half the bytes of single cameras, with a mean of streaming F1 at most .005 lower than
  that of the recommended Genie (`every: 75 ms`: each frame of a camera with 10 frames a second).
- **Rules**, each with at most one parameter (``RULES``). A frame goes up when the rule says so, and
  at the latest 400 ms after the last one of its view:

  - ``fixed`` (time): the last one is so old; no rule, for comparison.
  - ``moving`` (speed): a served track in view moves faster.
  - ``new``: time since the last one is at least 75 ms, doubled for each look in a row (at most two)
    that showed no new track.
  - ``uncertain`` (distance): the predicted place of a served track in view has a larger standard
    deviation.
  - ``displaced`` (distance): the car and the fastest served track in view together have moved
    farther since the last one.
  - ``undecided`` (probability): a track in view exists with a probability between this and 1 less
    this.

- **Drives**: the tracking sequences of ``where_it_pays.TUNING`` over both links, seed 1.

Declared after that search, before what follows was run: no rule was better than ``fixed`` with
150 ms, the plain setting `every: 150 ms`. It is judged once (``held_out``) on the sequences of
``where_it_pays.HELD_OUT`` over both links, seed 1, and in the town over 5G, seed 101. The default
stays, whatever comes out.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable, Iterator, Sequence
from itertools import chain
from typing import Any
from unittest import mock

import pandas as pd

from benchmarks.where_it_pays import HELD_OUT, OUT, TUNING, sequences
from genie_sim import runner
from genie_sim.analysis import metrics
from genie_sim.analysis.text_table import markdown
from genie_sim.core import genies
from genie_sim.core.maps import Viewer
from genie_sim.core.paced_genie import PacedGenie
from genie_sim.messages import CameraPose, Effect, ObjectLookups
from genie_sim.scenario.scenario import load_scenario
from genie_sim.study.design import load_design, read_design

FILE, HELD_OUT_FILE = OUT / "look_rules.csv", OUT / "look_rules_held_out.csv"
CHOSEN = "fixed", 150.0
MS = 1_000_000
USUAL_NS, LONGEST_NS = 75 * MS, 400 * MS
RULES: dict[str, tuple[float | None, ...]] = {
    "fixed": (150.0, 250.0),
    "moving": (0.5, 1.0, 2.0, 4.0),
    "new": (None,),
    "uncertain": (0.5, 0.7, 1.0, 1.5),
    "displaced": (0.5, 1.0, 2.0, 4.0),
    "undecided": (0.05, 0.1, 0.2, 0.3),
}
UNITS = {"fixed": "ms", "moving": "m/s", "uncertain": "m", "displaced": "m"}


class RarerLooks(PacedGenie):
    """Lets frames of predictable views go up less often, as the rule of the class says."""

    rule: str
    parameter: float | None

    def __init__(self, *arguments: Any, **parts: Any) -> None:
        super().__init__(*arguments, **parts)
        self._sent_ns: int | None = None
        self._sent_pose: CameraPose | None = None
        self._looks_without_new = 0

    def _on_frame(self, frame: Any, now_ns: int) -> list[Effect]:
        pacer = self._pacer
        if pacer is not None and frame.pose is not None:
            pacer._every_ns = USUAL_NS if self._is_due(frame, now_ns) else LONGEST_NS
            before = len(pacer._outstanding)
        effects = super()._on_frame(frame, now_ns)
        if pacer is not None and frame.header in pacer._outstanding:
            assert before <= len(pacer._outstanding)
            self._sent_ns, self._sent_pose = frame.header.stamp_ns, frame.pose
        return effects

    def _on_answer(self, answer: Any, own: bool, now_ns: int) -> list[Effect]:
        effects = super()._on_answer(answer, own, now_ns)
        if not own:
            for effect in effects:
                if isinstance(effect, ObjectLookups):
                    is_new = effect.requests > effect.updates
                    self._looks_without_new = 0 if is_new else self._looks_without_new + 1
        return effects

    def _is_due(self, frame: Any, now_ns: int) -> bool:
        if self._sent_ns is None or self._sent_pose is None:
            return True
        age_ns = frame.header.stamp_ns - self._sent_ns
        limit = 0.0 if self.parameter is None else self.parameter
        viewer = Viewer(frame.header, frame.pose, frame.horizontal_fov_rad)
        if self.rule == "fixed":
            return age_ns >= limit * MS
        if self.rule == "new":
            return age_ns >= USUAL_NS << min(self._looks_without_new, 2)
        if self.rule == "undecided":
            return any(limit < p < 1 - limit for p in self._existences(viewer, now_ns))
        served, _ = self.object_map.visible(viewer, self._view_range_m, now_ns)
        motions = [detection.motion for detection in served if detection.motion is not None]
        if self.rule == "uncertain":
            return any(motion.sigma_m > limit for motion in motions)
        fastest_mps = max((math.hypot(*motion.velocity_mps) for motion in motions), default=0.0)
        if self.rule == "moving":
            return fastest_mps > limit
        moved_m = math.hypot(
            frame.pose.east_m - self._sent_pose.east_m, frame.pose.north_m - self._sent_pose.north_m
        )
        return moved_m + fastest_mps * age_ns * 1e-9 > limit

    def _existences(self, viewer: Viewer, now_ns: int) -> Iterator[float]:
        """Of all tracks in view, served or not."""
        sector = self.object_map._sector(viewer, self._view_range_m)
        for track in self.object_map._inside(sector.box()):
            if sector.distance_m(*track.place(now_ns)) is not None:
                yield self.object_map.existence(track, now_ns)


def measured(scenario: Any) -> tuple[float, float]:
    """Streaming F1 of the recommended Genie, and what it sends up [B]."""
    prepared = runner.prepare(scenario)
    tables = {name: table.columns() for name, table in runner.simulate(prepared).items()}
    computed = metrics.compute(runner.methods_of(prepared), tables, intervals=False)
    (f1,) = (m.value for m in computed if (m.metric, m.component) == ("streaming_f1", ""))
    assert f1 is not None
    return f1, float(tables["frames"]["bytes_up"].sum())


def scenarios(conditions: dict[str, dict[str, Any]], seed: int = 1) -> Iterator[tuple[str, Any]]:
    """These conditions with the recommended Genie alone."""
    genie = {"name": "genie", "method": "genie", "genie": "recommended"}
    data = {
        "name": "look_rules",
        "scenario": "3car_hetero",
        "set": {"methods": [genie], "record": ["held"]},
        "seeds": [seed],
        "axes": {"condition": {"list": conditions}},
    }
    for point in read_design(data, "look_rules").points():
        (name,) = point.levels
        yield str(name), load_scenario(point.scenario, point.overrides, seed)


def compared(
    scenarios: Iterable[tuple[str, Any]], rules: Sequence[tuple[str, float | None]]
) -> pd.DataFrame:
    """A row for each condition, rule and parameter."""
    rows = []
    for condition, scenario in scenarios:
        usual_f1, usual_bytes = measured(scenario)
        for rule, parameter in rules:
            genie = type(rule, (RarerLooks,), {"rule": rule, "parameter": parameter})
            with mock.patch.object(genies, "PacedGenie", genie):
                f1, sent_bytes = measured(scenario)
            rows.append(
                {
                    "condition": condition,
                    "rule": rule,
                    "parameter": parameter,
                    "f1_less_usual": round(f1 - usual_f1, 4),
                    "bytes_of_usual": round(sent_bytes / usual_bytes, 4),
                }
            )
        print(condition, flush=True)
    return pd.DataFrame(rows)


def search() -> None:
    """Every rule on the tuning set."""
    rules = [(rule, parameter) for rule, values in RULES.items() for parameter in values]
    compared(scenarios(sequences(TUNING)), rules).to_csv(FILE, index=False)


def held_out() -> None:
    """The setting that the search left, on what nobody had chosen by. Run it once."""
    shipped = load_design("where_it_pays").axes["condition"].cases
    assert isinstance(shipped, dict)
    conditions = chain(
        scenarios(sequences(HELD_OUT)), scenarios({"town, 5G": shipped["town, 5G"]}, seed=101)
    )
    compared(conditions, [CHOSEN]).to_csv(HELD_OUT_FILE, index=False)


def table(rows: pd.DataFrame) -> str:
    """A row for each rule and parameter: means over the conditions, and the worst."""
    lines = []
    for (rule, parameter), group in rows.groupby(["rule", "parameter"], sort=False, dropna=False):
        number = "" if math.isnan(parameter) else f"{parameter:g} {UNITS.get(str(rule), '')}"
        lost = group["f1_less_usual"]
        lines.append(
            [
                f"`{rule}`",
                number.strip(),
                f"{100 * group['bytes_of_usual'].mean():.0f}",
                f"{lost.mean():+.3f}",
                f"{lost.min():+.3f}",
            ]
        )
    return markdown(["rule", "parameter", "bytes, %", "F1, mean", "worst"], lines)


def held_out_table(rows: pd.DataFrame) -> str:
    """What the setting changes in each condition."""
    changes = rows.set_index("condition")["f1_less_usual"]
    cells = [[str(name), f"{change:+.3f}"] for name, change in changes.items()]
    return markdown(["", "F1"], [*cells, ["mean", f"{changes.mean():+.3f}"]])


if __name__ == "__main__":
    {"search": search, "held_out": held_out}[sys.argv[1]]()
