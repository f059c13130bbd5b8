"""What a reader of a run's results is told beforehand."""

from __future__ import annotations

import pytest

from genie_sim.base.errors import UserError
from genie_sim.runs.folder import run_in_memory
from genie_sim.runs.prepare import notes
from genie_sim.scenario.reading import load_scenario

RECOMMENDED = "methods=[{name: mine, method: recommended}]"
OTHER_TIMES = "cars replay recordings at different times, so what one sees is not there for others"


def test_a_run_says_where_cars_cannot_share_what_they_see():
    assert notes(load_scenario("street_3car_hetero", [RECOMMENDED])) == [
        f"mine: edges share nothing with cars, because {OTHER_TIMES}."
    ]


@pytest.mark.parametrize(
    ("scenario", "method"),
    [
        ("fleet_30", "method: recommended"),
        ("street_3car_hetero", "method: recommended, sharing: null"),
        ("street_3car_hetero", "method: genie"),
    ],
    ids=["one world", "as the user wants it", "a Genie that looks at misses"],
)
def test_and_says_nothing_elsewhere(scenario: str, method: str):
    assert notes(load_scenario(scenario, [f"methods=[{{name: mine, {method}}}]"])) == []


def test_what_edges_tell_is_refused_there_in_one_line():
    method = "methods=[{name: mine, method: recommended, sharing: {p_min: 0.9}}]"
    with pytest.raises(UserError) as error:
        run_in_memory(load_scenario("street_3car_hetero", [method]))
    assert f"recommended: sharing: {OTHER_TIMES}; leave it out" in str(error.value)
    assert "\n" not in str(error.value)
