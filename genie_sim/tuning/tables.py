"""The tables of a search: its points, the designs of its report, and their paired differences."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from genie_sim.tuning.design import SearchDesign
from genie_sim.tuning.evaluation import Candidate
from genie_sim.tuning.front import Interval, Relation, Table, groups, interval, means, relation
from genie_sim.tuning.searcher import OUTCOME, REASON, ROWS, MethodSearch

if TYPE_CHECKING:
    import pandas as pd


class Reported(NamedTuple):
    """A design with its numbers: the means over the tuning set by which it was chosen, and
    replicates of the held-out set.
    """

    candidate: Candidate
    tuning: Table | None  # None for methods as they are in the scenario
    held_out: Table

    def intervals(self, design: SearchDesign) -> list[Interval]:
        """Of each target, over the held-out set."""
        return [
            interval(self.held_out[:, place], target.is_share)
            for place, target in enumerate(design.targets)
        ]


def of_points(design: SearchDesign, searches: Sequence[MethodSearch]) -> "pd.DataFrame":
    """One row per point: what was tried, what became of it, and its means over the tuning set.

    They are what the search went by, and too good for the points it chose: the report is made of
    the held-out set.
    """
    import pandas as pd

    rows = []
    for search in searches:
        for trial in search.trials():
            if not trial.state.is_finished():
                continue
            values = search.values(trial)
            of_cases = trial.user_attrs.get(ROWS)
            numbers = [None] * len(design.targets) if of_cases is None else list(means(of_cases))
            rows.append(
                {
                    "method": search.method,
                    "point": trial.number,
                    "state": trial.user_attrs[OUTCOME],
                    "runs": 0 if of_cases is None else len(of_cases),
                    "reason": trial.user_attrs.get(REASON, ""),
                    **{target_column(design, place): x for place, x in enumerate(numbers)},
                    **{parameter_column(search, name): value for name, value in values.items()},
                }
            )
    return pd.DataFrame(rows)


def of_designs(
    design: SearchDesign, searches: Sequence[MethodSearch], reported: Sequence[Reported]
) -> "pd.DataFrame":
    """One row per design of the front, and per method of the scenario as it is: held-out means with
    intervals, and which others it cannot be told apart from.
    """
    import pandas as pd

    by_name = {item.candidate.name: item for item in reported}
    relations = all_relations(design, reported)
    equal = {
        name: [other for other in by_name if other != name and relations[name, other].is_equal]
        for name in sorted(by_name, key=lambda name: _signed_first(design, by_name[name]))
    }
    leaders = groups(equal)
    search_of = {search.method: search for search in searches}
    rows = []
    for name, item in by_name.items():
        intervals = item.intervals(design)
        columns: dict[str, Any] = {
            "design": name,
            "method": item.candidate.method or name,
            "tuned": bool(item.candidate.method),
            "within_constraints": all(
                constraint.excess(intervals[len(design.objectives.all) + place].value) <= 0
                for place, constraint in enumerate(design.constraints)
            ),
            "group": leaders[name],
            "equal_to": ", ".join(equal[name]),
            "dominated_by": next(
                (
                    other
                    for other in by_name
                    if other != name and relations[name, other].is_dominated
                ),
                "",
            ),
        }
        for place, measured in enumerate(intervals):
            column = target_column(design, place)
            columns |= {
                column: measured.value,
                f"{column} low": measured.low,
                f"{column} high": measured.high,
            }
        if item.candidate.method:
            search = search_of[item.candidate.method]
            columns |= {
                parameter_column(search, key): value for key, value in item.candidate.values.items()
            }
        rows.append(columns)
    return pd.DataFrame(rows)


def of_differences(design: SearchDesign, reported: Sequence[Reported]) -> "pd.DataFrame":
    """Paired differences of every two designs, over the held-out set: design minus ``from``."""
    import pandas as pd

    rows = [
        {
            "design": name,
            "from": other,
            "metric": target.text,
            "value": difference.value,
            "low": difference.low,
            "high": difference.high,
        }
        for (name, other), compared in all_relations(design, reported).items()
        for target, difference in zip(design.targets, compared.differences, strict=True)
        if name < other
    ]
    columns = ["design", "from", "metric", "value", "low", "high"]
    return pd.DataFrame(rows, columns=columns)


def all_relations(
    design: SearchDesign, reported: Sequence[Reported]
) -> Mapping[tuple[str, str], Relation]:
    """How each design compares with each other one."""
    signs = [objective.sign for objective in design.objectives.all]
    return {
        (one.candidate.name, other.candidate.name): relation(one.held_out, other.held_out, signs)
        for one in reported
        for other in reported
        if one is not other
    }


def target_column(design: SearchDesign, place: int) -> str:
    """The column of an objective or a constraint."""
    return design.targets[place].text


def parameter_column(search: MethodSearch, name: str) -> str:
    """The column of a parameter: its name, and its unit in brackets."""
    unit = search.space.unit(name)
    return f"{name} [{unit}]" if unit else name


def _signed_first(design: SearchDesign, item: Reported) -> float:
    """The first objective, less is better."""
    return design.objectives.all[0].sign * item.intervals(design)[0].value
