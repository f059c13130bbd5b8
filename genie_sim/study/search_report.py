"""The tables, the designs in words and the figures of a search."""

import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from genie_sim.analysis.drawing import in_style
from genie_sim.analysis.registry import METRICS
from genie_sim.analysis.statistics import across_seeds
from genie_sim.base.text import number_text
from genie_sim.study import tables
from genie_sim.study.search_design import Point, SearchDesign, Target, Values, metric_of

if TYPE_CHECKING:
    import optuna
    import pandas as pd
    from optuna.trial import FrozenTrial

WITHIN = 0.01  # of the best accuracy: what the cheapest design may lose of it
SLICES = 6  # parameters side by side in a figure

Front = Mapping[Point, Sequence[float]]
Studies = Mapping[str, "optuna.Study"]


class Pick(NamedTuple):
    """A design in words: its file, what to say of it, and what it is."""

    file: str
    text: str
    design: str
    method: str
    values: Values


def of_points(studies: Studies) -> "pd.DataFrame":
    """One row per point: what was tried, what became of it, and its means over the tuning set.

    They are what the search went by, and too good for the points it chose: the report is made of
    the held-out set.
    """
    import pandas as pd

    of_methods = []
    for method, study in studies.items():
        table = study.trials_dataframe(attrs=("number", "state", "values", "user_attrs", "params"))
        table.columns = [re.sub("^(values|user_attrs|params)_", "", str(name)) for name in table]
        table.insert(0, "method", method)
        of_methods.append(table)
    return pd.concat(of_methods)


def of_differences(numbers: "pd.DataFrame") -> "pd.DataFrame":
    """Paired differences of every two designs, over the held-out set: design minus ``from``."""
    import pandas as pd

    names = list(dict.fromkeys(numbers["design"]))
    from_each = [
        tables.differences(
            numbers[numbers["design"].isin(names[place:])], ["design"], "design", name
        ).assign(**{"from": name})
        for place, name in enumerate(names[:-1])
    ]
    return pd.concat(from_each)[["design", "from", "metric", "value", "low", "high"]]


def of_designs(
    design: SearchDesign,
    points: Sequence[Point],
    numbers: "pd.DataFrame",
    differences: "pd.DataFrame",
) -> "pd.DataFrame":
    """One row per design of the front, and per method of the scenario as it is: held-out means with
    intervals, and which others no objective tells it apart from.
    """
    import pandas as pd

    means = across_seeds(numbers, ["design"])
    is_apart = differences["metric"].isin(design.objectives.targets) & (
        (differences["low"] > 0) | (differences["high"] < 0)
    )
    pairs = differences.loc[is_apart, ["design", "from"]].itertuples(index=False, name=None)
    apart = {frozenset(pair) for pair in pairs}
    rows = []
    for point in points:
        of_point = means[means["design"] == point.name].set_index("metric")
        own: Mapping[Any, Any] = of_point.reindex(design.targets).to_dict("index")
        equal = [
            other.name
            for other in points
            if other != point and frozenset((point.name, other.name)) not in apart
        ]
        row: dict[str, Any] = {
            "design": point.name,
            "method": point.method or point.name,
            "tuned": bool(point.method),
            "within_constraints": all(
                constraint.excess(own[constraint.target]["value"]) <= 0
                for constraint in design.constraints
            ),
            "equal_to": ", ".join(equal),
        }
        for target in design.targets:
            row[target] = own[target]["value"]
            row |= {f"{target} {end}": own[target][end] for end in ("low", "high")}
        for name, value in point.values.items():
            row[design.methods[point.method].column(name)] = value
        rows.append(row)
    return pd.DataFrame(rows)


def picks(design: SearchDesign, front: Front, table: "pd.DataFrame") -> list[Pick]:
    """The most accurate design, the cheapest within .01 of its accuracy, and the fastest.

    Accuracy is the first objective; speed the first other one that is a time, and cost the first
    other one that is none. They are chosen by their means over the tuning set, so the held-out
    numbers beside them are not the best of many.
    """
    signs = design.objectives.signs

    def best(objective: int, points: Sequence[Point]) -> Point:
        """Of equal ones the best in the other objectives."""
        signed = {
            point: [sign * value for sign, value in zip(signs, front[point], strict=True)]
            for point in points
        }
        return min(points, key=lambda point: (signed[point][objective], *signed[point]))

    accurate = best(0, list(front))
    chosen = {"most accurate": accurate}
    is_time = [METRICS[metric_of(target)].unit == "ms" for target in design.objectives.targets]
    if False in is_time[1:]:
        near = [point for point in front if abs(front[point][0] - front[accurate][0]) <= WITHIN]
        chosen[f"cheapest within {WITHIN:g}"] = best(is_time.index(False, 1), near)
    if True in is_time[1:]:
        chosen["fastest"] = best(is_time.index(True, 1), list(front))
    rows: Mapping[Any, Any] = table.set_index("design").to_dict("index")
    return [
        Pick(
            file=words.partition(" within")[0].replace(" ", "_"),
            text=f"{words.capitalize()}: {point.name}. {_text(design, point, rows[point.name])}",
            design=point.name,
            method=point.method,
            values=point.values,
        )
        for words, point in chosen.items()
    ]


def _text(design: SearchDesign, point: Point, row: Mapping[str, Any]) -> str:
    """Its held-out numbers and its settings."""
    numbers = []
    for target in design.targets:
        info = METRICS[metric_of(target)]
        value, low, high = (
            number_text(info.factor * row[column])
            for column in (target, f"{target} low", f"{target} high")
        )
        numbers.append(f"{_title(target)} {value} ({low} to {high}) {info.unit}".rstrip())
    space = design.methods[point.method]
    settings = [
        f"{name} {number_text(value) if isinstance(value, float) else value} "
        f"{space.parameters[name].axis.unit}".rstrip()
        for name, value in point.values.items()
    ]
    return f"{'; '.join(numbers)}. Settings: {', '.join(settings)}."


def _title(target: Target) -> str:
    """The metric's title, with placement and component where it has them."""
    metric, *where = target.split("/", 2)
    more = [name for name in where if name != "all"]
    title = METRICS[metric].title
    return f"{title} ({', '.join(more)})" if more else title


def draw(design: SearchDesign, studies: Studies, folder: Path) -> None:
    """Writes Optuna's figures of the tuning set: which parameters decide the first objective, how
    it goes along those that do most, and the front of it and each other objective. A method with
    one value for each parameter has only the fronts.
    """
    import numpy as np
    from matplotlib import pyplot
    from matplotlib.ticker import NullFormatter
    from optuna.importance import get_param_importances
    from optuna.visualization import matplotlib as plots

    from genie_sim.analysis import figures

    folder.mkdir(exist_ok=True)
    infos = [METRICS[metric_of(target)] for target in design.objectives.targets]
    (first, label), *others = [
        (_value(place, info.factor), f"{_title(target)} [{info.unit or 1}]")
        for place, (target, info) in enumerate(zip(design.objectives.targets, infos, strict=True))
    ]
    for method, study in studies.items():
        with in_style():
            signed = _value(0, design.objectives.signs[0])
            drawn: dict[str, Any] = {}
            searched = [
                name
                for name in get_param_importances(study, target=signed)
                if len({trial.params.get(name) for trial in study.trials}) > 1
            ]
            if most := searched[:SLICES]:
                drawn["slices"] = plots.plot_slice(study, most, target=first, target_name=label)
                drawn["importances"] = plots.plot_param_importances(
                    study, target=signed, target_name=label
                )
            for target, (value, other) in zip(design.objectives.targets[1:], others, strict=True):
                drawn[f"front_{target.replace('/', '_')}"] = plots.plot_pareto_front(
                    study, targets=_both(first, value), target_names=[label, other]
                )
            for name, axes in drawn.items():
                panels = np.ravel(np.asarray(axes))
                for panel in panels:
                    panel.xaxis.set_minor_formatter(NullFormatter())
                figure = panels[0].figure
                figure.suptitle(f"{method}, tuning set")
                figure.set_layout_engine("constrained")
                figures.save(figure, folder, f"{method}_{name}")
                pyplot.close(figure)


Value = Callable[["FrozenTrial"], float]


def _value(place: int, factor: int) -> Value:
    """An objective of a trial, times a factor."""
    return lambda trial: factor * trial.values[place]


def _both(one: Value, other: Value) -> "Callable[[FrozenTrial], tuple[float, float]]":
    """Two objectives of a trial."""
    return lambda trial: (one(trial), other(trial))
