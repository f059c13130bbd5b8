"""What a car learns, which the paper leaves open, in whole runs."""

from __future__ import annotations

import functools

import pytest

import genie_sim as gs
from genie_sim.paper.numbers import Number, of_run, placed

WINDOW = ("cars[0].route.window=[0 s, 3 s]", "cars[1].route.window=[0 s, 3 s]")


@functools.cache
def numbers(*settings, scenario="street_2car_hetero", methods=("genie",)):
    window = WINDOW if "2car" in scenario else ()
    changed = [*window, *settings, f"methods=[{', '.join(methods)}]"]
    loaded = gs.load_scenario(scenario, changed, seed=1)
    return of_run(gs.run(loaded))


@pytest.mark.parametrize("forget_after", ["null", "2 s"])
@pytest.mark.parametrize("method", ["genie", "{method: central, name: genie}"])
def test_a_car_that_learns_from_its_own_node_only_holds_fewer_answers(method, forget_after):
    forgets = f"genie.object_map.forget_after={forget_after}"
    usual, own = (
        numbers(forgets, f"genie.car_learns={learns}", methods=(method,))
        for learns in ("all", "own")
    )
    key = placed("stored_images", "car")
    # no Genie on cars there
    assert own.get(key) == usual.get(key) if "central" in method else own[key] < usual[key]
    assert own[placed("stored_images", "edge")] >= usual[placed("stored_images", "edge")], (
        "edges learn from each other as ever"
    )


@pytest.mark.slow
def test_a_car_without_a_detector_learns_from_its_edge_anyway():
    usual, own = (
        numbers(f"genie.car_learns={learns}", scenario="street_case_study")
        for learns in ("all", "own")
    )
    with_detector, without = (
        Number("object_reuse", component=f"{car}/genie") for car in ("car1", "car2")
    )
    assert own[with_detector] < usual[with_detector]
    assert own[without] > 0.9 * usual[without] > 0
