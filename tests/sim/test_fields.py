"""Values that vary over a map."""

from __future__ import annotations

import pytest

from genie_sim.base.seeds import Draws
from genie_sim.links.path_loss import NormalField

VALUES = Draws(1)


@pytest.mark.parametrize(("east_m", "north_m"), [(10.0, 3.0), (-20.0, 17.5), (320.0, 4.0)])
def test_a_field_is_continuous_across_the_lines_of_its_grid(east_m: float, north_m: float):
    field = NormalField(lambda column, row: VALUES.normal(f"{column % 7} {row % 7}"), 10.0)
    step_m = 1e-6
    before, after = (field.at(east_m + step, north_m) for step in (-step_m, step_m))
    assert before == pytest.approx(after, abs=1e-4)
    before, after = (field.at(north_m, east_m + step) for step in (-step_m, step_m))
    assert before == pytest.approx(after, abs=1e-4)
