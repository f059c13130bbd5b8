"""Runs with made-up metrics, for searches whose answer is known."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from genie_sim.errors import UserError
from genie_sim.recording.results import Metric
from genie_sim.tuning.design import Case, Part
from genie_sim.tuning.evaluation import Candidate

# the values of parameters and the case, to values of metrics
Function = Callable[[Mapping[str, Any], Case], Mapping[str, float | None]]


@dataclass(frozen=True)
class MadeUpRun:
    """A run whose metrics are a function of its point and its case."""

    run_id: str
    values: Mapping[str, Any]
    case: Case
    function: Function
    place: str = "made up"
    frames: float = 1.0

    def measure(self, shared: Any, folder: Path) -> Mapping[str, Sequence[Metric]]:
        numbers = self.function(self.values, self.case)
        return {
            self.run_id: [
                Metric(name, "m", "all", "", value=value, unit="ms")
                for name, value in numbers.items()
            ]
        }


@dataclass
class MadeUpPlans:
    """Keeps which cases were asked for."""

    function: Function
    cases: list[Case] = field(default_factory=list)
    shared: Mapping[str, Any] = field(default_factory=dict)

    def runs(
        self, candidate: Candidate, part: Part, cases: Sequence[Case]
    ) -> Mapping[Case, MadeUpRun]:
        if candidate.values.get("x") == "broken":
            raise UserError("a design that cannot be run")
        self.cases += cases
        return {case: self._run(candidate.values, case) for case in cases}

    def _run(self, values: Mapping[str, Any], case: Case) -> MadeUpRun:
        text = repr((sorted(values.items()), case, self.function.__name__))
        run_id = hashlib.sha256(text.encode()).hexdigest()[:12]
        return MadeUpRun(run_id, dict(values), case, self.function)
